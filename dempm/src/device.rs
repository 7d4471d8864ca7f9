//! The choice between CPU and GPUs.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// The value of `--device`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    /// The first NVIDIA GPU that works, else the CPU.
    Auto,
    /// All cores of the processor.
    Cpu,
    /// The NVIDIA GPU with this number; without a number the first, or all where several are of use.
    Cuda(Option<usize>),
}

impl FromStr for Device {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "cuda" => Ok(Self::Cuda(None)),
            _ => text
                .strip_prefix("cuda:")
                .and_then(|number| number.parse().ok())
                .map(|number| Self::Cuda(Some(number)))
                .ok_or_else(|| "valid: auto, cpu, cuda, cuda:N".to_owned()),
        }
    }
}

impl fmt::Display for Device {
    /// As the option takes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Cpu => f.write_str("cpu"),
            Self::Cuda(None) => f.write_str("cuda"),
            Self::Cuda(Some(number)) => write!(f, "cuda:{number}"),
        }
    }
}

/// The GPUs found for a choice.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// The GPUs to use; none for the CPU.
    pub gpus: Vec<Arc<gpu::Device>>,
    /// The reason why `auto` falls back to the CPU.
    pub fallback: Option<String>,
    /// Whether that reason is a fault, and not only the absence of a GPU.
    pub is_faulty: bool,
}

impl Selection {
    /// The first GPU; `None` for the CPU.
    pub fn first(&self) -> Option<Arc<gpu::Device>> {
        self.gpus.first().cloned()
    }
}

impl Device {
    /// The device of one simulation: at most one GPU.
    ///
    /// # Errors
    /// If a GPU that was asked for cannot be used.
    pub fn select(self) -> Result<Selection, gpu::Error> {
        match self {
            Self::Cpu => Ok(Selection::default()),
            Self::Cuda(number) => {
                let gpu = gpu::Device::new(number.unwrap_or(0))?;
                Ok(Selection { gpus: vec![gpu], ..Selection::default() })
            }
            Self::Auto => Ok(match gpu::Device::new(0) {
                Ok(gpu) => Selection { gpus: vec![gpu], ..Selection::default() },
                Err(reason) => Selection {
                    is_faulty: !matches!(reason, gpu::Error::NoDriver | gpu::Error::NoDevice),
                    fallback: Some(reason.to_string()),
                    ..Selection::default()
                },
            }),
        }
    }

    /// The devices of several simulations: all visible GPUs unless the user names one.
    ///
    /// # Errors
    /// If a GPU cannot be used, except for the first one of `auto`.
    pub fn select_all(self) -> Result<Selection, gpu::Error> {
        let mut selection = self.select()?;
        if matches!(self, Self::Auto | Self::Cuda(None)) && !selection.gpus.is_empty() {
            for ordinal in 1..gpu::Device::count() {
                selection.gpus.push(gpu::Device::new(ordinal)?);
            }
        }
        Ok(selection)
    }

    /// The GPU of one simulation; `None` for the CPU.
    ///
    /// # Errors
    /// If a GPU that was asked for cannot be used.
    pub fn open(self) -> Result<Option<Arc<gpu::Device>>, gpu::Error> {
        Ok(self.select()?.first())
    }

    /// The GPU of the rank with number `local` on its host: the visible GPU of that number, or the
    /// only one if each rank sees its own, unless the user names one.
    ///
    /// # Errors
    /// If the GPU cannot be used, and for `cpu`.
    pub fn open_for_rank(self, local: usize) -> Result<Arc<gpu::Device>, gpu::Error> {
        match self {
            Self::Cpu => Err(gpu::Error::NoDevice),
            Self::Cuda(Some(number)) => gpu::Device::new(number),
            Self::Cuda(None) | Self::Auto => gpu::Device::new(local % gpu::Device::count().max(1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names() {
        assert_eq!("auto".parse(), Ok(Device::Auto));
        assert_eq!("cpu".parse(), Ok(Device::Cpu));
        assert_eq!("cuda".parse(), Ok(Device::Cuda(None)));
        assert_eq!("cuda:3".parse(), Ok(Device::Cuda(Some(3))));
        for wrong in ["", "gpu", "cuda:", "cuda:-1", "cuda:x"] {
            assert!(wrong.parse::<Device>().is_err(), "{wrong}");
        }
    }
}
