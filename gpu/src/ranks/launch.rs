//! Which rank this process is, from what launchers leave in its environment.

/// What a launcher says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launch {
    pub rank: usize,
    /// How many ranks there are; 1 without a launcher.
    pub size: usize,
    /// Number of this rank on its host.
    pub local_rank: usize,
    /// Host and port where rank 0 is found.
    pub address: (String, u16),
}

/// A variable of the environment that cannot be right.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum LaunchError {
    #[error("{name}={value} in the environment is not {expected}")]
    Variable { name: &'static str, value: String, expected: &'static str },
    #[error("{present} is set in the environment, but not {missing}")]
    Incomplete { present: &'static str, missing: &'static str },
}

/// Rank, number of ranks and rank on the host, as launchers name them.
const LAUNCHERS: [[&str; 3]; 3] = [
    // torchrun, and whoever sets them by hand
    ["RANK", "WORLD_SIZE", "LOCAL_RANK"],
    // mpirun of Open MPI
    ["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_RANK"],
    // srun; the number of tasks of the step, since a batch script has the others too
    ["SLURM_PROCID", "SLURM_STEP_NUM_TASKS", "SLURM_LOCALID"],
];

/// Port of rank 0 unless MASTER_PORT says otherwise.
const PORT: u16 = 29_500;

impl Launch {
    /// From the environment of this process.
    ///
    /// # Errors
    /// Variables that contradict each other or are no numbers.
    pub fn from_environment() -> Result<Self, LaunchError> {
        Self::from(|name| std::env::var(name).ok())
    }

    fn from(variable: impl Fn(&str) -> Option<String>) -> Result<Self, LaunchError> {
        let number = |name: &'static str| -> Result<Option<usize>, LaunchError> {
            let Some(value) = variable(name) else { return Ok(None) };
            let parsed = value.trim().parse();
            let expected = "a whole number";
            parsed.map(Some).map_err(|_| LaunchError::Variable { name, value, expected })
        };
        let address = |torch: bool| -> Result<(String, u16), LaunchError> {
            let host = variable("MASTER_ADDR").unwrap_or_else(|| "127.0.0.1".to_owned());
            let port = number("MASTER_PORT")?.unwrap_or(PORT.into());
            // torchrun itself listens on MASTER_PORT.
            let port = if torch { port + 1 } else { port };
            u16::try_from(port).map(|port| (host, port)).map_err(|_| LaunchError::Variable {
                name: "MASTER_PORT",
                value: port.to_string(),
                expected: "a port",
            })
        };
        for [rank_name, size_name, local_name] in LAUNCHERS {
            let Some(size) = number(size_name)? else { continue };
            let missing = |missing| LaunchError::Incomplete { present: size_name, missing };
            let rank = number(rank_name)?.ok_or_else(|| missing(rank_name))?;
            if size <= 1 {
                break;
            }
            if rank >= size {
                let (name, value) = (rank_name, rank.to_string());
                return Err(LaunchError::Variable { name, value, expected: "below their number" });
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
    fn launch(environment: &str) -> Result<Launch, LaunchError> {
        Launch::from(|name| {
            let pairs = environment.split_whitespace().filter_map(|pair| pair.split_once('='));
            pairs.into_iter().find(|(key, _)| *key == name).map(|(_, value)| value.to_owned())
        })
    }

    fn of(environment: &str) -> (usize, usize, usize, String, u16) {
        let Launch { rank, size, local_rank, address: (host, port) } = launch(environment).unwrap();
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
    fn what_cannot_be_is_refused() {
        for (environment, name) in [
            ("RANK=x WORLD_SIZE=2 LOCAL_RANK=0", "RANK"),
            ("RANK=2 WORLD_SIZE=2 LOCAL_RANK=0", "RANK"),
            ("WORLD_SIZE=2", "RANK"),
            ("RANK=0 WORLD_SIZE=2", "LOCAL_RANK"),
            ("RANK=0 WORLD_SIZE=2 LOCAL_RANK=0 MASTER_PORT=70000", "MASTER_PORT"),
        ] {
            let error = launch(environment).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
}
