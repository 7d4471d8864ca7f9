//! One definition of what crosses from Rust to CUDA.
//!
//! [`cuda_struct!`](crate::cuda_struct) defines a struct in Rust and writes the same struct in CUDA
//! C++, where the compiler checks its size and the offset of every field against those in Rust.
//! [`definitions!`](crate::definitions) lists the texts that a source begins with:
//!
//! ```
//! use gpu::{Pointer, ConstPointer, cuda_struct, cuda_types, definitions};
//!
//! cuda_types! {
//!     /// Basis functions around one point; defined in `basis.cu`.
//!     pub struct Stencil;
//! }
//! cuda_struct! {
//!     /// Points on a grid.
//!     pub struct Points {
//!         /// Lower and upper corner of the grid (m).
//!         pub corners: [[f64; 2]; 2],
//!         /// Masses (kg).
//!         pub mass: ConstPointer<f64>,
//!         pub stencil: Pointer<Stencil>,
//!     }
//! }
//!
//! let text = definitions![Stencil, Points];
//! assert!(text.contains("struct Stencil;"));
//! assert!(text.contains("double corners[2][2];"));
//! assert!(text.contains("const double *mass;"));
//! ```

use cudarc::driver::{DeviceRepr, ValidAsZeroBits};

/// A type that has a name in CUDA C++.
pub trait CudaName {
    /// That name.
    const NAME: &'static str;
}

/// A struct that CUDA C++ is told of.
pub trait CudaDefinition {
    /// Its definition, with checks of its layout, or its declaration.
    fn definition() -> String;
}

/// A type whose values cross from Rust to CUDA as they are.
///
/// # Safety
/// Both languages lay it out alike, all bits zero are one of its values, and it is no reference.
pub unsafe trait CudaType: DeviceRepr + ValidAsZeroBits + Copy {
    /// Declares a variable of this type in CUDA C++.
    fn declare(variable: &str) -> String;
}

macro_rules! numbers {
    ($($rust:ty = $cuda:literal),*) => {$(
        impl CudaName for $rust {
            const NAME: &'static str = $cuda;
        }
        // SAFETY: the same number in both languages.
        unsafe impl CudaType for $rust {
            fn declare(variable: &str) -> String {
                format!("{} {variable}", Self::NAME)
            }
        }
    )*};
}

numbers!(
    f32 = "float",
    f64 = "double",
    i32 = "int",
    u8 = "unsigned char",
    u16 = "unsigned short",
    u32 = "unsigned",
    u64 = "unsigned long long"
);

// SAFETY: entries follow one another in both languages.
unsafe impl<T: CudaType, const N: usize> CudaType for [T; N]
where
    [T; N]: DeviceRepr + ValidAsZeroBits,
{
    fn declare(variable: &str) -> String {
        T::declare(&format!("{variable}[{N}]"))
    }
}

/// Defines structs of [`CudaType`]s for Rust and for CUDA C++, where they have the same name and the
/// same fields. `#[align(N)]` before the struct aligns it in CUDA C++ only, for loads of several numbers at
/// once; the checks fail where that moves a field. A struct may have one generic parameter with a bound.
#[macro_export]
macro_rules! cuda_struct {
    ($(
        $(#[doc = $doc:literal])*
        $(#[derive($($derive:ident),*)])?
        $(#[align($align:expr)])?
        $vis:vis struct $name:ident $(<$real:ident: $bound:path>)? {
            $($(#[$field_doc:meta])* $field_vis:vis $field:ident: $type:ty),* $(,)?
        }
    )*) => {$(
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug $($(, $derive)*)?)]
        $vis struct $name $(<$real: $bound>)? {
            $($(#[$field_doc])* $field_vis $field: $type),*
        }

        impl $(<$real: $bound>)? $crate::CudaName for $name $(<$real>)? {
            const NAME: &'static str = stringify!($name);
        }

        impl $(<$real: $bound>)? $crate::CudaDefinition for $name $(<$real>)? {
            fn definition() -> String {
                let align: &[usize] = &[$($align)?];
                $crate::define_struct(
                    (file!(), line!()),
                    (stringify!($name), align.first().copied(), size_of::<Self>()),
                    &[$((
                        stringify!($field),
                        <$type as $crate::CudaType>::declare(stringify!($field)),
                        ::std::mem::offset_of!(Self, $field),
                    )),*],
                )
            }
        }

        // SAFETY: all fields are such types, and CUDA C++ checks where they lie.
        unsafe impl $(<$real: $bound>)? $crate::CudaType for $name $(<$real>)? {
            fn declare(variable: &str) -> String {
                format!("{} {variable}", stringify!($name))
            }
        }

        // SAFETY: as above.
        unsafe impl $(<$real: $bound>)? $crate::DeviceRepr for $name $(<$real>)? {}
        // SAFETY: as above.
        unsafe impl $(<$real: $bound>)? $crate::ValidAsZeroBits for $name $(<$real>)? {}
    )*};
}

/// Names types that only CUDA C++ knows, for [`Pointer`](crate::Pointer)s to them. `struct Name;` is declared by
/// [`definitions!`](crate::definitions); `type Name;` is a type that the source knows by then.
#[macro_export]
macro_rules! cuda_types {
    ($($(#[$doc:meta])* $vis:vis $kind:ident $name:ident;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        $vis enum $name {}

        impl $crate::CudaName for $name {
            const NAME: &'static str = stringify!($name);
        }

        $crate::cuda_types!(@$kind $name);
    )*};
    (@struct $name:ident) => {
        impl $crate::CudaDefinition for $name {
            fn definition() -> String {
                concat!("struct ", stringify!($name), ";\n").to_owned()
            }
        }
    };
    (@type $name:ident) => {};
}

/// Defines constants for Rust, as associated constants of an empty type, and for CUDA C++, as an enum. Its
/// type is an integer.
#[macro_export]
macro_rules! cuda_enum {
    ($(
        $(#[$doc:meta])*
        $vis:vis enum $name:ident: $type:ty {
            $($(#[$constant_doc:meta])* $constant:ident = $value:literal),* $(,)?
        }
    )*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        $vis enum $name {}

        // Some constants are used in CUDA sources only.
        #[allow(dead_code)]
        impl $name {
            $($(#[$constant_doc])* $vis const $constant: $type = $value;)*
        }

        impl $crate::CudaDefinition for $name {
            fn definition() -> String {
                let constants = [$(concat!(stringify!($constant), " = ", $value)),*].join(", ");
                let integer = <$type as $crate::CudaName>::NAME;
                format!(concat!("enum ", stringify!($name), " : {} {{ {} }};\n"), integer, constants)
            }
        }
    )*};
}

/// Definitions of structs in CUDA C++, in the order of the list: one that is a field of another goes
/// before it.
#[macro_export]
macro_rules! definitions {
    ($($type:ty),* $(,)?) => {
        [$(<$type as $crate::CudaDefinition>::definition()),*].concat()
    };
}

/// Files of a source, one after the other, each under its name in messages of the compiler.
#[macro_export]
macro_rules! files {
    ($($file:literal),* $(,)?) => {
        concat!($("#line 1 \"", $file, "\"\n", include_str!($file)),*)
    };
}

/// The text of a struct: where it is defined in Rust; its name, alignment and size; name, declaration
/// and offset of every field. For [`cuda_struct!`](crate::cuda_struct).
#[doc(hidden)]
pub fn define_struct(
    (file, line): (&str, u32),
    (name, align, size): (&str, Option<usize>, usize),
    fields: &[(&str, String, usize)],
) -> String {
    let align = align.map_or(String::new(), |n| format!("alignas({n}) "));
    let declarations: String =
        fields.iter().map(|(_, declaration, _)| format!("    {declaration};\n")).collect();
    let differs = format!("\"{name} is laid out otherwise in Rust\"");
    let offsets: String = fields
        .iter()
        .map(|(field, _, offset)| {
            // NVRTC has no `offsetof`.
            let found = format!("__INTADDR__(&(({name}*)0)->{field})");
            format!("static_assert({found} == {offset}, {differs});\n")
        })
        .collect();
    format!(
        "#line {line} \"{file}\"\nstruct {align}{name} {{\n{declarations}}};\n\
         static_assert(sizeof({name}) == {size}, {differs});\n{offsets}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ConstPointer, Pointer, compile, nvrtc_for_tests};

    cuda_types! {
        struct Stencil;
        type Half;
    }

    cuda_struct! {
        /// All kinds of numbers.
        #[derive(Default, PartialEq)]
        #[align(16)]
        struct Numbers {
            a: u8,
            b: u16,
            c: f32,
            d: f64,
            e: i32,
            f: u32,
            g: u64,
        }

        /// A vector that is loaded at once, in either precision.
        #[align(2 * size_of::<R>())]
        struct Pair<R: CudaType> {
            x: R,
            y: R,
        }

        /// All kinds of fields, in either precision.
        struct Fields<R: CudaType> {
            numbers: [Numbers; 2],
            real: [[R; 2]; 3],
            number: [R; 2],
            read: ConstPointer<f64>,
            both: [Pointer<Stencil>; 2],
            half: ConstPointer<Half>,
        }

        /// Aligned in CUDA C++ only, which makes it longer there.
        #[align(16)]
        struct TooShort {
            number: f64,
        }
    }

    cuda_enum! {
        /// Why something failed.
        enum Fault: i32 {
            BROKEN = 1,
            LOST = 2,
        }
    }

    fn source<R: CudaType>() -> String {
        let known = "struct Half { unsigned short bits; };\n";
        format!("{known}{}", definitions![Numbers, Stencil, Fault, Pair<R>, Fields<R>])
    }

    #[test]
    fn text_of_definitions() {
        let text = source::<f32>();
        for part in [
            "struct alignas(16) Numbers {\n    unsigned char a;\n    unsigned short b;\n    float c;\n",
            "    double d;\n    int e;\n    unsigned f;\n    unsigned long long g;\n};\n",
            "static_assert(sizeof(Numbers) == 32, \"Numbers is laid out otherwise in Rust\");\n",
            "static_assert(__INTADDR__(&((Numbers*)0)->g) == 24, ",
            "struct Stencil;\n",
            "enum Fault : int { BROKEN = 1, LOST = 2 };\n",
            "struct alignas(8) Pair {\n    float x;\n    float y;\n};\n",
            "struct Fields {\n    Numbers numbers[2];\n    float real[3][2];\n    float number[2];\n",
            "    const double *read;\n    Stencil *both[2];\n    const Half *half;\n};\n",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
    }

    #[test]
    fn layouts_compile_and_are_checked() {
        if !nvrtc_for_tests() {
            return;
        }
        for text in [source::<f32>(), source::<f64>()] {
            compile("fields.cu", &text, "sm_80", &[]).unwrap();
        }
        let error = compile("short.cu", &definitions![TooShort], "sm_80", &[]).unwrap_err();
        let error = error.to_string();
        assert!(error.contains("TooShort is laid out otherwise in Rust"), "{error}");
        assert!(error.contains("abi.rs"), "{error}");
    }
}
