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
    /// An NVIDIA GPU by its number.
    Cuda(usize),
}

impl FromStr for Device {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "cpu" => Ok(Self::Cpu),
            "cuda" => Ok(Self::Cuda(0)),
            _ => text
                .strip_prefix("cuda:")
                .and_then(|number| number.parse().ok())
                .map(Self::Cuda)
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
            Self::Cuda(ordinal) => gpu::Device::new(ordinal).map(Some),
            Self::Auto => match gpu::Device::new(0) {
                Ok(device) => Ok(Some(device)),
                Err(reason) => {
                    eprintln!("running on the CPU: {reason}");
                    Ok(None)
                }
            },
        }
    }

    /// The GPUs for work on several scenes: all that there are for `auto`; none for the CPU.
    ///
    /// # Errors
    /// When a GPU cannot be used, but for the first one of `auto`.
    pub fn open_all(self) -> Result<Vec<Arc<gpu::Device>>, gpu::Error> {
        let mut devices: Vec<_> = self.open()?.into_iter().collect();
        if self == Self::Auto && !devices.is_empty() {
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
        assert_eq!("cuda".parse(), Ok(Device::Cuda(0)));
        assert_eq!("cuda:3".parse(), Ok(Device::Cuda(3)));
        for wrong in ["", "gpu", "cuda:", "cuda:-1", "cuda:x"] {
            assert!(wrong.parse::<Device>().is_err(), "{wrong}");
        }
    }
}
