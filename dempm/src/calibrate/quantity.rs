//! Measured quantities and their units.

/// A column of a table of measurements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    AxialStrain,
    ShearStrain,
    VolumetricStrain,
    DeviatoricStress,
    ShearStress,
    AxialStress,
}

impl Quantity {
    /// Name in tables, and in `sd` of a target.
    pub fn name(self) -> &'static str {
        match self {
            Self::AxialStrain => "axial_strain",
            Self::ShearStrain => "shear_strain",
            Self::VolumetricStrain => "volumetric_strain",
            Self::DeviatoricStress => "deviatoric_stress",
            Self::ShearStress => "shear_stress",
            Self::AxialStress => "axial_stress",
        }
    }

    fn is_strain(self) -> bool {
        matches!(self, Self::AxialStrain | Self::ShearStrain | Self::VolumetricStrain)
    }

    /// Units that its columns may have.
    pub fn units(self) -> &'static str {
        if self.is_strain() { "[-] or [%]" } else { "[Pa], [kPa] or [MPa]" }
    }

    /// From a unit to 1 or Pa; `None` for units of something else.
    pub fn factor(self, unit: &str) -> Option<f64> {
        match (unit, self.is_strain()) {
            ("-", true) => Some(1.0),
            ("%", true) => Some(0.01),
            ("Pa", false) => Some(1.0),
            ("kPa", false) => Some(1.0e3),
            ("MPa", false) => Some(1.0e6),
            _ => None,
        }
    }

    /// Title of an axis, and the factor from 1 or Pa to its unit.
    pub fn axis(self) -> (String, f64) {
        let (unit, factor) = if self.is_strain() { ("%", 100.0) } else { ("kPa", 1.0e-3) };
        (format!("{} [{unit}]", self.name().replace('_', " ")), factor)
    }
}
