//! Several processes that train one network: each learns from its own windows of every step, and
//! the sums of their gradients move the weights of all of them alike.

/// What can be wrong between processes.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum RankError {
    #[error("{name} is `{value}`, but it must be {range}")]
    #[diagnostic(help(
        "processes of one training are told apart by RANK, and all have the same WORLD_SIZE, \
         MASTER_ADDR and MASTER_PORT"
    ))]
    Environment { name: &'static str, value: String, range: String },
    #[error("rank {rank} cannot {action} {address}")]
    Connect { rank: usize, action: &'static str, address: String, source: std::io::Error },
    #[error("rank {rank} has lost rank {other}")]
    Lost { rank: usize, other: usize, source: std::io::Error },
    #[error("rank {other} and rank 0 do not train the same")]
    #[diagnostic(help("all processes need the same configuration, data and number of processes"))]
    Differs { other: usize },
}

/// Sums over all processes of a training.
pub trait AllReduce {
    /// Which process this is, from 0.
    fn rank(&self) -> usize;

    /// How many there are.
    fn ranks(&self) -> usize;

    /// Replaces numbers by their sums over all processes, the same bits on each.
    ///
    /// # Errors
    /// If another process is gone.
    fn sum(&mut self, values: &mut [f32]) -> Result<(), RankError>;
}

/// One process.
pub struct Alone;

impl AllReduce for Alone {
    fn rank(&self) -> usize {
        0
    }

    fn ranks(&self) -> usize {
        1
    }

    fn sum(&mut self, _: &mut [f32]) -> Result<(), RankError> {
        Ok(())
    }
}

/// Where a process is among others, from the variables that launchers of PyTorch and MPI jobs set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    pub rank: usize,
    pub ranks: usize,
    /// Where rank 0 listens, host:port.
    pub address: String,
}

impl Place {
    /// Reads RANK, WORLD_SIZE, MASTER_ADDR and MASTER_PORT; without WORLD_SIZE there is one process.
    ///
    /// # Errors
    /// If a variable is missing or no number, or the rank is not below the number of processes.
    pub fn from_variables(
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Option<Self>, RankError> {
        let Some(size) = variable("WORLD_SIZE") else { return Ok(None) };
        let wrong = |name, value: Option<String>, range: &str| RankError::Environment {
            name,
            value: value.unwrap_or_default(),
            range: range.to_owned(),
        };
        let ranks = size.parse().ok().filter(|&n| (1..=1024).contains(&n));
        let ranks = ranks.ok_or_else(|| wrong("WORLD_SIZE", Some(size), "from 1 to 1024"))?;
        if ranks == 1 {
            return Ok(None);
        }
        let rank = variable("RANK");
        let number = rank.as_deref().and_then(|rank| rank.parse().ok()).filter(|&r| r < ranks);
        let number =
            number.ok_or_else(|| wrong("RANK", rank, &format!("from 0 to {}", ranks - 1)))?;
        let host = variable("MASTER_ADDR").unwrap_or_else(|| "127.0.0.1".to_owned());
        let port = variable("MASTER_PORT");
        let address = match port.as_deref().and_then(|port| port.parse::<u16>().ok()) {
            Some(port) => format!("{host}:{port}"),
            None => return Err(wrong("MASTER_PORT", port, "a port, such as 29500")),
        };
        Ok(Some(Self { rank: number, ranks, address }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(variables: &[(&str, &str)]) -> Result<Option<Place>, RankError> {
        Place::from_variables(|name| {
            let found = variables.iter().find(|(key, _)| *key == name);
            found.map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn places_come_from_the_environment() {
        assert_eq!(place(&[]).unwrap(), None);
        assert_eq!(place(&[("WORLD_SIZE", "1"), ("RANK", "0")]).unwrap(), None);
        let all = [("WORLD_SIZE", "3"), ("RANK", "2"), ("MASTER_PORT", "29500")];
        let expected = Place { rank: 2, ranks: 3, address: "127.0.0.1:29500".to_owned() };
        assert_eq!(place(&all).unwrap(), Some(expected));
        for (wrong, name) in [
            ([("WORLD_SIZE", "many"), ("RANK", "0"), ("MASTER_PORT", "1")], "WORLD_SIZE"),
            ([("WORLD_SIZE", "2"), ("RANK", "2"), ("MASTER_PORT", "1")], "RANK"),
            ([("WORLD_SIZE", "2"), ("RANK", "1"), ("MASTER_PORT", "x")], "MASTER_PORT"),
        ] {
            let error = place(&wrong).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
}
