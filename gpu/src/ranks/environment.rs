//! Which rank this process is, from the environment variables that launchers set.

/// This process among the ranks of a launcher (torchrun, `mpirun`, `srun`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Environment {
    /// Number of this rank, from 0.
    pub rank: usize,
    /// Number of ranks; 1 without a launcher.
    pub size: usize,
    /// Number of this rank on its host.
    pub local_rank: usize,
    /// Host and port at which rank 0 listens.
    pub address: (String, u16),
}

/// An environment variable that is wrong or missing.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum EnvironmentError {
    /// A variable has an impossible value.
    #[error("environment variable {name}={value} is not {expected}")]
    Variable {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: String,
        /// Values it may have.
        expected: &'static str,
    },
    /// One of two variables that belong together is missing.
    #[error("environment variable {present} is set, but {missing} is not")]
    Incomplete {
        /// The variable that is set.
        present: &'static str,
        /// The variable that is missing.
        missing: &'static str,
    },
}

/// Variables for rank, number of ranks and rank on the host.
const LAUNCHERS: [[&str; 3]; 3] = [
    // torchrun, or set by hand
    ["RANK", "WORLD_SIZE", "LOCAL_RANK"],
    // Open MPI's mpirun
    ["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_RANK"],
    // srun; not SLURM_NTASKS, which batch scripts outside of srun have too
    ["SLURM_PROCID", "SLURM_STEP_NUM_TASKS", "SLURM_LOCALID"],
];

/// Port of rank 0 unless MASTER_PORT is set.
const PORT: u16 = 29_500;

impl Environment {
    /// Reads the environment variables of this process.
    ///
    /// # Errors
    /// Variables are missing, contradict each other or are no numbers.
    pub fn read() -> Result<Self, EnvironmentError> {
        Self::from(|name| std::env::var(name).ok())
    }

    fn from(variable: impl Fn(&str) -> Option<String>) -> Result<Self, EnvironmentError> {
        let number = |name: &'static str| -> Result<Option<usize>, EnvironmentError> {
            let Some(value) = variable(name) else { return Ok(None) };
            let parsed = value.trim().parse();
            let expected = "a whole number";
            parsed.map(Some).map_err(|_| EnvironmentError::Variable { name, value, expected })
        };
        let address = |torch: bool| -> Result<(String, u16), EnvironmentError> {
            let host = variable("MASTER_ADDR").unwrap_or_else(|| "127.0.0.1".to_owned());
            let port = number("MASTER_PORT")?.unwrap_or(PORT.into());
            // torchrun itself listens on MASTER_PORT.
            let port = if torch { port + 1 } else { port };
            u16::try_from(port).map(|port| (host, port)).map_err(|_| EnvironmentError::Variable {
                name: "MASTER_PORT",
                value: port.to_string(),
                expected: "a port number",
            })
        };
        for [rank_name, size_name, local_name] in LAUNCHERS {
            let Some(size) = number(size_name)? else { continue };
            let missing = |missing| EnvironmentError::Incomplete { present: size_name, missing };
            let rank = number(rank_name)?.ok_or_else(|| missing(rank_name))?;
            if size <= 1 {
                break;
            }
            if rank >= size {
                let (name, value) = (rank_name, rank.to_string());
                return Err(EnvironmentError::Variable {
                    name,
                    value,
                    expected: "less than the number of ranks",
                });
            }
            let local_rank = number(local_name)?.ok_or_else(|| missing(local_name))?;
            let address = address(variable("TORCHELASTIC_RUN_ID").is_some())?;
            return Ok(Self { rank, size, local_rank, address });
        }
        Ok(Self { rank: 0, size: 1, local_rank: 0, address: address(false)? })
    }

    /// Whether there is more than one rank.
    pub fn is_shared(&self) -> bool {
        self.size > 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parses `NAME=value` pairs.
    fn parse(variables: &str) -> Result<Environment, EnvironmentError> {
        Environment::from(|name| {
            let pairs = variables.split_whitespace().filter_map(|pair| pair.split_once('='));
            pairs.into_iter().find(|(key, _)| *key == name).map(|(_, value)| value.to_owned())
        })
    }

    fn of(variables: &str) -> (usize, usize, usize, String, u16) {
        let Environment { rank, size, local_rank, address: (host, port) } =
            parse(variables).unwrap();
        (rank, size, local_rank, host, port)
    }

    #[test]
    fn launchers() {
        let here = || "127.0.0.1".to_owned();
        assert_eq!(of(""), (0, 1, 0, here(), 29_500));
        assert_eq!(of("RANK=0 WORLD_SIZE=1 LOCAL_RANK=0"), (0, 1, 0, here(), 29_500));
        assert_eq!(
            of("RANK=5 WORLD_SIZE=8 LOCAL_RANK=1 MASTER_ADDR=node7 MASTER_PORT=1234"),
            (5, 8, 1, "node7".to_owned(), 1234)
        );
        assert_eq!(
            of("RANK=1 WORLD_SIZE=2 LOCAL_RANK=1 MASTER_PORT=29500 TORCHELASTIC_RUN_ID=none"),
            (1, 2, 1, here(), 29_501)
        );
        let open_mpi = "OMPI_COMM_WORLD_RANK=3 OMPI_COMM_WORLD_SIZE=4 OMPI_COMM_WORLD_LOCAL_RANK=1";
        assert_eq!(of(open_mpi), (3, 4, 1, here(), 29_500));
        let srun = "SLURM_PROCID=2 SLURM_NTASKS=4 SLURM_STEP_NUM_TASKS=4 SLURM_LOCALID=0";
        assert_eq!(of(srun), (2, 4, 0, here(), 29_500));
        // A batch script that has not been started by srun is alone.
        assert_eq!(of("SLURM_PROCID=0 SLURM_NTASKS=4 SLURM_LOCALID=0").1, 1);
    }

    #[test]
    fn impossible_values_are_refused() {
        for (variables, name) in [
            ("RANK=x WORLD_SIZE=2 LOCAL_RANK=0", "RANK"),
            ("RANK=2 WORLD_SIZE=2 LOCAL_RANK=0", "RANK"),
            ("WORLD_SIZE=2", "RANK"),
            ("RANK=0 WORLD_SIZE=2", "LOCAL_RANK"),
            ("RANK=0 WORLD_SIZE=2 LOCAL_RANK=0 MASTER_PORT=70000", "MASTER_PORT"),
        ] {
            let error = parse(variables).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
}
