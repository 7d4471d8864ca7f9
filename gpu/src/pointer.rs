//! Typed addresses in device memory.

use std::fmt::{self, Debug, Formatter};
use std::marker::PhantomData;

use cudarc::driver::{CudaStream, DevicePtr, DeviceRepr, ValidAsZeroBits};

use crate::abi::{CudaName, CudaType};

macro_rules! pointer {
    ($(#[$doc:meta])* $name:ident, $format:literal) => {
        $(#[$doc])*
        #[repr(transparent)]
        pub struct $name<T>(u64, PhantomData<*const T>);

        // SAFETY: an address, of which only kernels make use.
        unsafe impl<T> Send for $name<T> {}
        // SAFETY: as above.
        unsafe impl<T> Sync for $name<T> {}

        impl<T> $name<T> {
            /// Points nowhere.
            pub const NULL: Self = Self(0, PhantomData);

            /// The first entry of an array. All work on the array is queued on `stream`, or ordered
            /// with it by the caller.
            pub fn to(array: &impl DevicePtr<T>, stream: &CudaStream) -> Self {
                Self(array.device_ptr(stream).0, PhantomData)
            }

            /// An address on the device.
            pub fn from_address(address: u64) -> Self {
                Self(address, PhantomData)
            }

            /// The address on the device; 0 is nowhere.
            pub fn address(self) -> u64 {
                self.0
            }

            /// Whether it points nowhere.
            pub fn is_null(self) -> bool {
                self.0 == 0
            }

            /// The same memory as entries of another type.
            pub fn cast<U>(self) -> $name<U> {
                $name(self.0, PhantomData)
            }

            /// The entry `count` entries further on.
            pub fn offset(self, count: usize) -> Self
            where
                T: DeviceRepr,
            {
                Self(self.0 + (count * size_of::<T>()) as u64, PhantomData)
            }
        }

        impl<T> Clone for $name<T> {
            fn clone(&self) -> Self {
                *self
            }
        }

        impl<T> Copy for $name<T> {}

        impl<T> Default for $name<T> {
            fn default() -> Self {
                Self::NULL
            }
        }

        impl<T> PartialEq for $name<T> {
            fn eq(&self, other: &Self) -> bool {
                self.0 == other.0
            }
        }

        impl<T> Debug for $name<T> {
            fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
                write!(f, "{:#x}", self.0)
            }
        }

        // SAFETY: an address.
        unsafe impl<T> DeviceRepr for $name<T> {}
        // SAFETY: points nowhere.
        unsafe impl<T> ValidAsZeroBits for $name<T> {}
        // SAFETY: addresses have 64 bits in both languages.
        unsafe impl<T: CudaName> CudaType for $name<T> {
            fn declare(variable: &str) -> String {
                format!($format, T::NAME, variable)
            }
        }
    };
}

pointer!(
    /// An address in device memory: `T*` in CUDA C++.
    Pointer,
    "{} *{}"
);
pointer!(
    /// An address in device memory that is only read from: `const T*` in CUDA C++.
    ConstPointer,
    "const {} *{}"
);

impl<T> From<Pointer<T>> for ConstPointer<T> {
    fn from(pointer: Pointer<T>) -> Self {
        Self(pointer.0, PhantomData)
    }
}
