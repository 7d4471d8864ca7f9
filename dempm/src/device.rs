//! Where a run is advanced.

use std::str::FromStr;
use std::sync::Arc;

/// The user's choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    /// The first NVIDIA GPU if there is one that works, else the CPU.
    Auto,
    /// All cores of the processor.
    Cpu,
    /// The NVIDIA GPU of a number; without one the first, or all where there is work for several.
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

impl Device {
    /// The GPU to use, `None` for the CPU. Where `auto` falls back to the CPU, one line on standard
    /// error says why.
    ///
    /// # Errors
    /// When a GPU that was asked for cannot be used.
    pub fn open(self) -> Result<Option<Arc<gpu::Device>>, gpu::Error> {
        match self {
            Self::Cpu => Ok(None),
            Self::Cuda(number) => gpu::Device::new(number.unwrap_or(0)).map(Some),
            Self::Auto => match gpu::Device::new(0) {
                Ok(device) => Ok(Some(device)),
                Err(reason) => {
                    eprintln!("running on the CPU: {reason}");
                    Ok(None)
                }
            },
        }
    }

    /// The GPU of rank number `local` on its host: the one of that number among the visible ones
    /// (which may be one for each rank), unless the user names one.
    ///
    /// # Errors
    /// When the GPU cannot be used; `cpu` is refused too.
    pub fn open_for_rank(self, local: usize) -> Result<Arc<gpu::Device>, gpu::Error> {
        match self {
            Self::Cpu => Err(gpu::Error::NoDevice),
            Self::Cuda(Some(number)) => gpu::Device::new(number),
            Self::Cuda(None) | Self::Auto => gpu::Device::new(local % gpu::Device::count().max(1)),
        }
    }

    /// The GPUs for work on several scenes: all that there are unless the user names one; none for the CPU.
    ///
    /// # Errors
    /// When a GPU cannot be used, but for the first one of `auto`.
    pub fn open_all(self) -> Result<Vec<Arc<gpu::Device>>, gpu::Error> {
        let mut devices: Vec<_> = self.open()?.into_iter().collect();
        if matches!(self, Self::Auto | Self::Cuda(None)) && !devices.is_empty() {
            for ordinal in 1..gpu::Device::count() {
                devices.push(gpu::Device::new(ordinal)?);
            }
        }
        Ok(devices)
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
