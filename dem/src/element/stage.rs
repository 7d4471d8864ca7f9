//! Stages of a path.

use serde::{Deserialize, Serialize};

/// One stage of a path, as written in element test files.
///
/// Pressures are compressive stresses (Pa). Axial rates are shortening rates of the `y` axis
/// (1/s): positive compresses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Stage {
    /// Both axes at `pressure`; ends in equilibrium, or after `duration` (s).
    Isotropic {
        /// Of both axes (Pa).
        pressure: f64,
        /// Without it, the stage ends in equilibrium (s).
        duration: Option<f64>,
    },
    /// `y` shortens at a rate, `x` keeps its length.
    Oedometric {
        /// Of `y` (1/s).
        shortening_rate: f64,
        /// End of the stage.
        until: Until,
    },
    /// `y` shortens at a rate, `x` at `lateral` times that rate.
    ProportionalStrain {
        /// Of `y` (1/s).
        shortening_rate: f64,
        /// Shortening of `x` over that of `y`: 0 is oedometric, 1 isotropic.
        lateral: f64,
        /// End of the stage.
        until: Until,
    },
    /// `y` shortens at a rate, `x` is held at `pressure`; ends at an axial `strain`.
    Biaxial {
        /// Along `x` (Pa).
        pressure: f64,
        /// Of `y` (1/s).
        shortening_rate: f64,
        /// Axial strain at the end.
        strain: f64,
    },
    /// `L_xy = shear_rate` alone; ends at a shear `strain`.
    ConstantVolumeShear {
        /// `L_xy` (1/s).
        shear_rate: f64,
        /// Shear strain at the end.
        strain: f64,
    },
    /// `L_xy = shear_rate` with the normal stress along `y` held at `pressure` and `x` fixed.
    ConstantPressureShear {
        /// Along `y` (Pa).
        pressure: f64,
        /// `L_xy` (1/s).
        shear_rate: f64,
        /// Shear strain at the end.
        strain: f64,
    },
    /// A constant velocity gradient, rows `[[xx, xy], [yx, yy]]` (1/s).
    VelocityGradient {
        /// `L` (1/s).
        gradient: [[f64; 2]; 2],
        /// Of the stage (s).
        duration: f64,
    },
    /// Rate or pressure per axis, and the shear components (1/s).
    Mixed {
        /// Along `x`.
        xx: Axis,
        /// Along `y`.
        yy: Axis,
        /// `L_xy` (1/s).
        #[serde(default)]
        xy: f64,
        /// `L_yx` (1/s).
        #[serde(default)]
        yx: f64,
        /// Of the stage (s).
        duration: f64,
    },
}

/// End of a stage that compresses by strain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Until {
    /// Axial strain of this stage (always positive).
    Strain(f64),
    /// Vertical pressure (Pa).
    Pressure(f64),
}

/// Control of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Axis {
    /// Strain rate (1/s), extension positive.
    Rate(f64),
    /// Normal stress (Pa), compression positive.
    Pressure(f64),
}

/// Control of each component of the velocity gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// Along `x`.
    pub xx: Axis,
    /// Along `y`.
    pub yy: Axis,
    /// `L_xy` (1/s).
    pub xy: f64,
    /// `L_yx` (1/s).
    pub yx: f64,
}

/// When a stage ends.
#[derive(Clone, Copy, Debug)]
pub(super) enum End {
    Duration(f64),
    /// When the vertical pressure has risen (`loading`) or fallen to this.
    Vertical {
        pressure: f64,
        loading: bool,
    },
    /// When both pressures and all forces are in balance.
    Balanced {
        pressure: f64,
    },
}

impl Stage {
    /// Name of the stage in files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Isotropic { .. } => "isotropic",
            Self::Oedometric { .. } => "oedometric",
            Self::ProportionalStrain { .. } => "proportional-strain",
            Self::Biaxial { .. } => "biaxial",
            Self::ConstantVolumeShear { .. } => "constant-volume-shear",
            Self::ConstantPressureShear { .. } => "constant-pressure-shear",
            Self::VelocityGradient { .. } => "velocity-gradient",
            Self::Mixed { .. } => "mixed",
        }
    }

    /// Checks the numbers of the stage.
    ///
    /// # Errors
    /// The key at fault and the reason: a number that is not finite, a strain that its rate never reaches, or a negative pressure
    /// or duration.
    pub fn check(&self) -> Result<(), (&'static str, &'static str)> {
        let positive = |key, x: f64| {
            if x > 0.0 && x.is_finite() { Ok(()) } else { Err((key, "must be positive")) }
        };
        let moving = |key, x: f64| {
            if x != 0.0 && x.is_finite() { Ok(()) } else { Err((key, "must be finite and not 0")) }
        };
        let finite = |key, x: f64| {
            if x.is_finite() { Ok(()) } else { Err((key, "must be finite")) }
        };
        let axis = |key, a: Axis| match a {
            Axis::Rate(rate) => finite(key, rate),
            Axis::Pressure(p) => positive(key, p),
        };
        let end = |until| match until {
            Until::Strain(x) => positive("until.strain", x),
            Until::Pressure(x) => positive("until.pressure", x),
        };
        match *self {
            Self::Isotropic { pressure, duration } => {
                positive("pressure", pressure)?;
                duration.map_or(Ok(()), |d| positive("duration", d))
            }
            Self::Oedometric { shortening_rate, until } => {
                moving("shortening_rate", shortening_rate)?;
                end(until)
            }
            Self::ProportionalStrain { shortening_rate, lateral, until } => {
                moving("shortening_rate", shortening_rate)?;
                finite("lateral", lateral)?;
                end(until)
            }
            Self::Biaxial { pressure, shortening_rate, strain } => {
                positive("pressure", pressure)?;
                moving("shortening_rate", shortening_rate)?;
                positive("strain", strain)
            }
            Self::ConstantVolumeShear { shear_rate, strain } => {
                moving("shear_rate", shear_rate)?;
                positive("strain", strain)
            }
            Self::ConstantPressureShear { pressure, shear_rate, strain } => {
                positive("pressure", pressure)?;
                moving("shear_rate", shear_rate)?;
                positive("strain", strain)
            }
            Self::VelocityGradient { gradient, duration } => {
                gradient.iter().flatten().try_for_each(|&x| finite("gradient", x))?;
                positive("duration", duration)
            }
            Self::Mixed { xx, yy, xy, yx, duration } => {
                axis("xx", xx)?;
                axis("yy", yy)?;
                finite("xy", xy)?;
                finite("yx", yx)?;
                positive("duration", duration)
            }
        }
    }

    pub(super) fn control(&self) -> Control {
        let still = Axis::Rate(0.0);
        let (xx, yy, xy, yx) = match *self {
            Self::Isotropic { pressure, .. } => {
                (Axis::Pressure(pressure), Axis::Pressure(pressure), 0.0, 0.0)
            }
            Self::Oedometric { shortening_rate, .. } => {
                (still, Axis::Rate(-shortening_rate), 0.0, 0.0)
            }
            Self::ProportionalStrain { shortening_rate, lateral, .. } => {
                (Axis::Rate(-lateral * shortening_rate), Axis::Rate(-shortening_rate), 0.0, 0.0)
            }
            Self::Biaxial { pressure, shortening_rate, .. } => {
                (Axis::Pressure(pressure), Axis::Rate(-shortening_rate), 0.0, 0.0)
            }
            Self::ConstantVolumeShear { shear_rate, .. } => (still, still, shear_rate, 0.0),
            Self::ConstantPressureShear { pressure, shear_rate, .. } => {
                (still, Axis::Pressure(pressure), shear_rate, 0.0)
            }
            Self::VelocityGradient { gradient: [[xx, xy], [yx, yy]], .. } => {
                (Axis::Rate(xx), Axis::Rate(yy), xy, yx)
            }
            Self::Mixed { xx, yy, xy, yx, .. } => (xx, yy, xy, yx),
        };
        Control { xx, yy, xy, yx }
    }

    pub(super) fn end(&self) -> End {
        match *self {
            Self::Isotropic { pressure, duration: None } => End::Balanced { pressure },
            Self::Oedometric { shortening_rate, until: Until::Pressure(pressure) }
            | Self::ProportionalStrain {
                shortening_rate, until: Until::Pressure(pressure), ..
            } => End::Vertical { pressure, loading: shortening_rate > 0.0 },
            Self::Oedometric { shortening_rate: rate, until: Until::Strain(strain) }
            | Self::ProportionalStrain {
                shortening_rate: rate,
                until: Until::Strain(strain),
                ..
            }
            | Self::Biaxial { shortening_rate: rate, strain, .. }
            | Self::ConstantVolumeShear { shear_rate: rate, strain }
            | Self::ConstantPressureShear { shear_rate: rate, strain, .. } => {
                End::Duration(strain / rate.abs())
            }
            Self::Isotropic { duration: Some(duration), .. }
            | Self::VelocityGradient { duration, .. }
            | Self::Mixed { duration, .. } => End::Duration(duration),
        }
    }
}
