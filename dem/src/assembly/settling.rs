//! The processor on which grains settle.

use super::error::AssemblyError;
use super::state::Assembly;
use crate::real::Real;

/// An assembly that settles, on the CPU or elsewhere.
pub trait Settling<R: Real> {
    /// See [`Assembly::set_drag`].
    fn set_drag(&mut self, rate: f64);

    /// Advances by `steps` DEM steps.
    ///
    /// # Errors
    /// As [`Assembly::advance`], or the processor failed.
    fn advance(&mut self, steps: usize) -> Result<(), AssemblyError>;

    /// See [`Assembly::agitation`].
    ///
    /// # Errors
    /// The processor failed.
    fn agitation(&mut self, gravity: f64) -> Result<f64, AssemblyError>;

    /// The assembly in its present state.
    ///
    /// # Errors
    /// The processor failed.
    fn finish(self: Box<Self>) -> Result<Assembly<R>, AssemblyError>;
}

/// Takes an assembly to the processor on which it settles.
pub type Start<'a, R> = dyn FnMut(Assembly<R>) -> Result<Box<dyn Settling<R>>, AssemblyError> + 'a;

/// Lets an assembly settle on the CPU.
///
/// # Errors
/// None; as [`Start`] wants it.
pub fn on_cpu<R: Real>(assembly: Assembly<R>) -> Result<Box<dyn Settling<R>>, AssemblyError> {
    Ok(Box::new(assembly))
}

impl<R: Real> Settling<R> for Assembly<R> {
    fn set_drag(&mut self, rate: f64) {
        self.set_drag(rate);
    }

    fn advance(&mut self, steps: usize) -> Result<(), AssemblyError> {
        self.advance(steps)
    }

    fn agitation(&mut self, gravity: f64) -> Result<f64, AssemblyError> {
        Ok(Assembly::agitation(self, gravity))
    }

    fn finish(self: Box<Self>) -> Result<Assembly<R>, AssemblyError> {
        Ok(*self)
    }
}
