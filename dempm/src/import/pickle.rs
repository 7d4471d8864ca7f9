//! Pickles of numpy arrays: what `numpy.load(..., allow_pickle=True)` reads, but without running code.
//!
//! A pickle is a program for a machine with a stack and a memo; the opcodes are those of
//! <https://github.com/python/cpython/blob/3.13/Lib/pickletools.py>. Only those for numbers, texts, tuples,
//! lists and numpy arrays are known here, so a file can ask for nothing else.

use std::collections::HashMap;
use std::io::{BufRead, Read};

use ndarray::{ArrayD, IxDyn, ShapeBuilder};

use super::number::Number;

/// Why a pickle cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PickleError {
    /// It is cut short or cannot be read.
    #[error("cannot read the Python object")]
    Io(#[from] std::io::Error),
    /// It holds something else than numbers, texts, tuples, lists and numpy arrays.
    #[error("there is a Python object of another kind: {0}")]
    Unknown(String),
    /// It contradicts itself.
    #[error("the Python object is damaged: {0}")]
    Damaged(&'static str),
}

type Result<T> = std::result::Result<T, PickleError>;

const NO_OPERAND: PickleError = PickleError::Damaged("an operation without its operands");

/// Place of an object in its [`Pickle`]. Objects refer to each other, at times in circles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Id(usize);

/// A Python object.
#[derive(Debug)]
enum Object {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
    Bytes(Vec<u8>),
    Tuple(Vec<Id>),
    List(Vec<Id>),
    Array(Array),
    Type(Number),
    Function(Function),
}

/// A numpy array.
#[derive(Debug, Default)]
struct Array {
    shape: Vec<usize>,
    /// Whether the first index runs fastest.
    fortran: bool,
    elements: Elements,
}

#[derive(Debug)]
enum Elements {
    /// Numbers in an object of bytes.
    Numbers(Number, Id),
    Objects(Vec<Id>),
}

impl Default for Elements {
    fn default() -> Self {
        Self::Objects(Vec::new())
    }
}

/// What a pickle may call.
#[derive(Clone, Copy, Debug)]
enum Function {
    /// `numpy.core.multiarray._reconstruct`: an empty array.
    Reconstruct,
    /// `numpy.core.multiarray.scalar`: an array without dimensions.
    Scalar,
    /// `numpy.dtype`
    Dtype,
    /// `numpy.ndarray`, an argument of `_reconstruct`.
    NdArray,
    /// `_codecs.encode`: bytes, in pickles of Python 2.
    Encode,
}

/// The objects of a pickle.
#[derive(Debug)]
pub(super) struct Pickle {
    objects: Vec<Object>,
    /// The object that was pickled.
    pub root: Id,
}

impl Pickle {
    /// Reads one object and all that it refers to.
    pub fn read(input: impl BufRead) -> Result<Self> {
        let (stack, marks, memo) = (Vec::new(), Vec::new(), HashMap::new());
        let mut machine = Machine { input, objects: Vec::new(), stack, marks, memo };
        let root = machine.run()?;
        Ok(Self { objects: machine.objects, root })
    }

    /// The items of a tuple, a list or an array of objects.
    pub fn items(&self, id: Id) -> Option<&[Id]> {
        match &self.objects[id.0] {
            Object::Tuple(items) | Object::List(items) => Some(items),
            Object::Array(Array { elements: Elements::Objects(items), .. }) => Some(items),
            _ => None,
        }
    }

    /// The shape of an array of objects.
    pub fn shape(&self, id: Id) -> Option<&[usize]> {
        match &self.objects[id.0] {
            Object::Array(array) => Some(&array.shape),
            _ => None,
        }
    }

    /// A number, or the numbers of an array.
    pub fn numbers(&self, id: Id) -> Option<ArrayD<f64>> {
        let scalar = |value: f64| Some(ArrayD::from_elem(IxDyn(&[]), value));
        match &self.objects[id.0] {
            Object::Int(value) => scalar(*value as f64),
            Object::Float(value) => scalar(*value),
            Object::Array(Array { shape, fortran, elements: Elements::Numbers(number, bytes) }) => {
                let Object::Bytes(bytes) = &self.objects[bytes.0] else { return None };
                let shape = IxDyn(shape).set_f(*fortran);
                ArrayD::from_shape_vec(shape, number.values(bytes)).ok()
            }
            _ => None,
        }
    }
}

struct Machine<R> {
    input: R,
    objects: Vec<Object>,
    stack: Vec<Id>,
    /// Heights of the stack that tuples and lists begin at.
    marks: Vec<usize>,
    memo: HashMap<u32, Id>,
}

impl<R: BufRead> Machine<R> {
    fn run(&mut self) -> Result<Id> {
        loop {
            let opcode = self.bytes::<1>()?[0];
            match opcode {
                b'.' => return self.pop(),
                // Protocol and frame only say what follows.
                0x80 => _ = self.bytes::<1>()?,
                0x95 => _ = self.bytes::<8>()?,
                b'(' => self.marks.push(self.stack.len()),
                b'N' => self.push(Object::None),
                0x88 => self.push(Object::Bool(true)),
                0x89 => self.push(Object::Bool(false)),
                b'J' => {
                    let value = i32::from_le_bytes(self.bytes()?);
                    self.push(Object::Int(value.into()));
                }
                b'K' => {
                    let [value] = self.bytes()?;
                    self.push(Object::Int(value.into()));
                }
                b'M' => {
                    let value = u16::from_le_bytes(self.bytes()?);
                    self.push(Object::Int(value.into()));
                }
                0x8a => self.long()?,
                b'G' => {
                    let value = f64::from_be_bytes(self.bytes()?);
                    self.push(Object::Float(value));
                }
                b'X' | 0x8c | 0x8d => {
                    let bytes = self.counted(opcode)?;
                    self.push(Object::Text(text(bytes)?));
                }
                b'B' | b'C' | b'T' | b'U' | 0x8e | 0x96 => {
                    let bytes = self.counted(opcode)?;
                    self.push(Object::Bytes(bytes));
                }
                b')' => self.push(Object::Tuple(Vec::new())),
                0x85..=0x87 => {
                    let items = self.pop_many(usize::from(opcode - 0x84))?;
                    self.push(Object::Tuple(items));
                }
                b't' => {
                    let items = self.pop_marked()?;
                    self.push(Object::Tuple(items));
                }
                b']' => self.push(Object::List(Vec::new())),
                b'a' => {
                    let item = self.pop()?;
                    self.extend(vec![item])?;
                }
                b'e' => {
                    let items = self.pop_marked()?;
                    self.extend(items)?;
                }
                b'q' => {
                    let [place] = self.bytes()?;
                    self.remember(place.into())?;
                }
                b'r' => {
                    let place = u32::from_le_bytes(self.bytes()?);
                    self.remember(place)?;
                }
                0x94 => self.remember(self.memo.len() as u32)?,
                b'h' => {
                    let [place] = self.bytes()?;
                    self.recall(place.into())?;
                }
                b'j' => {
                    let place = u32::from_le_bytes(self.bytes()?);
                    self.recall(place)?;
                }
                b'c' => {
                    let (module, name) = (self.line()?, self.line()?);
                    self.push(Object::Function(function(&module, &name)?));
                }
                0x93 => {
                    let [module, name] = self.pop_array()?;
                    let names = (&self.objects[module.0], &self.objects[name.0]);
                    let (Object::Text(module), Object::Text(name)) = names else {
                        return Err(PickleError::Damaged("a name that is no text"));
                    };
                    let function = function(module, name)?;
                    self.push(Object::Function(function));
                }
                b'R' => {
                    let [function, arguments] = self.pop_array()?;
                    let result = self.call(function, arguments)?;
                    self.push(result);
                }
                b'b' => {
                    let state = self.pop()?;
                    let object = *self.stack.last().ok_or(NO_OPERAND)?;
                    self.objects[object.0] = self.built(object, state)?;
                }
                other => return Err(PickleError::Unknown(format!("opcode {other:#04x}"))),
            }
        }
    }

    fn push(&mut self, object: Object) {
        self.stack.push(Id(self.objects.len()));
        self.objects.push(object);
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        self.input.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// Bytes after their number, whose width the opcode tells.
    fn counted(&mut self, opcode: u8) -> Result<Vec<u8>> {
        let length = match opcode {
            b'C' | b'U' | 0x8c => self.bytes::<1>()?[0].into(),
            b'B' | b'T' | b'X' => u32::from_le_bytes(self.bytes()?).into(),
            _ => u64::from_le_bytes(self.bytes()?),
        };
        // Grows with what is there: a wrong number must not take all memory.
        let mut bytes = Vec::new();
        self.input.by_ref().take(length).read_to_end(&mut bytes)?;
        match bytes.len() as u64 == length {
            true => Ok(bytes),
            false => Err(PickleError::Damaged("it ends early")),
        }
    }

    /// A line of text, without its end.
    fn line(&mut self) -> Result<String> {
        const LONGEST: u64 = 1000;
        let mut bytes = Vec::new();
        self.input.by_ref().take(LONGEST).read_until(b'\n', &mut bytes)?;
        bytes.pop();
        text(bytes)
    }

    /// An integer after its number of bytes, the least significant first.
    fn long(&mut self) -> Result<()> {
        let [length] = self.bytes()?;
        let mut bytes = vec![0; length.into()];
        self.input.read_exact(&mut bytes)?;
        let negative = bytes.last().is_some_and(|byte| byte & 0x80 != 0);
        let mut all = [if negative { 0xff } else { 0 }; 8];
        let place = all
            .get_mut(..bytes.len())
            .ok_or_else(|| PickleError::Unknown("a number of more than 64 bits".to_owned()))?;
        place.copy_from_slice(&bytes);
        self.push(Object::Int(i64::from_le_bytes(all)));
        Ok(())
    }

    fn pop(&mut self) -> Result<Id> {
        self.stack.pop().ok_or(NO_OPERAND)
    }

    fn pop_many(&mut self, count: usize) -> Result<Vec<Id>> {
        let rest = self.stack.len().checked_sub(count).ok_or(NO_OPERAND)?;
        Ok(self.stack.split_off(rest))
    }

    fn pop_array<const N: usize>(&mut self) -> Result<[Id; N]> {
        self.pop_many(N)?.try_into().map_err(|_| NO_OPERAND)
    }

    /// All objects above the last mark.
    fn pop_marked(&mut self) -> Result<Vec<Id>> {
        let mark = self.marks.pop().ok_or(NO_OPERAND)?;
        let count = self.stack.len().checked_sub(mark).ok_or(NO_OPERAND)?;
        self.pop_many(count)
    }

    /// Appends to the list on top of the stack.
    fn extend(&mut self, items: Vec<Id>) -> Result<()> {
        let list = *self.stack.last().ok_or(NO_OPERAND)?;
        let Object::List(list) = &mut self.objects[list.0] else { return Err(NO_OPERAND) };
        list.extend(items);
        Ok(())
    }

    fn remember(&mut self, place: u32) -> Result<()> {
        self.memo.insert(place, *self.stack.last().ok_or(NO_OPERAND)?);
        Ok(())
    }

    fn recall(&mut self, place: u32) -> Result<()> {
        let id = self.memo.get(&place).ok_or(PickleError::Damaged("an unknown reference"))?;
        self.stack.push(*id);
        Ok(())
    }

    fn call(&self, function: Id, arguments: Id) -> Result<Object> {
        let called = (&self.objects[function.0], &self.objects[arguments.0]);
        let (Object::Function(function), Object::Tuple(arguments)) = called else {
            return Err(PickleError::Damaged("a call of what is no function"));
        };
        let argument = |index: usize| Some(&self.objects[arguments.get(index)?.0]);
        match (function, argument(0), argument(1)) {
            // Its arguments describe an empty array; the state that follows replaces it.
            (Function::Reconstruct, ..) => Ok(Object::Array(Array::default())),
            (Function::Dtype, Some(Object::Text(name)), _) => match Number::from_name(name) {
                Some(number) => Ok(Object::Type(number)),
                None => Err(PickleError::Unknown(format!("an array of type {name}"))),
            },
            (Function::Scalar, Some(Object::Type(number)), Some(Object::Bytes(_))) => {
                let elements = Elements::Numbers(*number, arguments[1]);
                Ok(Object::Array(Array { elements, ..Array::default() }))
            }
            // Every byte is a character of Latin-1.
            (Function::Encode, Some(Object::Text(text)), _) => {
                let bytes: Option<Vec<u8>> = text.chars().map(|c| u8::try_from(c).ok()).collect();
                bytes.map(Object::Bytes).ok_or(PickleError::Damaged("a byte beyond 255"))
            }
            _ => Err(PickleError::Damaged("a call with other arguments")),
        }
    }

    /// An array or a type with a state, as `__setstate__` gives it.
    fn built(&self, object: Id, state: Id) -> Result<Object> {
        let Object::Tuple(ids) = &self.objects[state.0] else {
            return Err(PickleError::Damaged("a state that is no tuple"));
        };
        let state: Vec<&Object> = ids.iter().map(|id| &self.objects[id.0]).collect();
        match (&self.objects[object.0], &state[..]) {
            // Version, byte order, and what only structures have.
            (Object::Type(number), [_, Object::Text(order), ..]) => {
                Ok(Object::Type(number.with_order(order == ">")))
            }
            (
                Object::Array(_),
                [_, Object::Tuple(shape), Object::Type(number), Object::Bool(fortran), data],
            ) => {
                let size = |id: &Id| match &self.objects[id.0] {
                    Object::Int(size) => usize::try_from(*size).ok(),
                    _ => None,
                };
                let shape: Option<Vec<usize>> = shape.iter().map(size).collect();
                let shape = shape.ok_or(PickleError::Damaged("the shape of an array"))?;
                let elements = match data {
                    Object::Bytes(_) => Elements::Numbers(*number, ids[4]),
                    Object::List(items) => Elements::Objects(items.clone()),
                    _ => return Err(PickleError::Damaged("an array without elements")),
                };
                Ok(Object::Array(Array { shape, fortran: *fortran, elements }))
            }
            _ => Err(PickleError::Damaged("a state of another kind")),
        }
    }
}

fn text(bytes: Vec<u8>) -> Result<String> {
    String::from_utf8(bytes).map_err(|_| PickleError::Damaged("a text that is not UTF-8"))
}

fn function(module: &str, name: &str) -> Result<Function> {
    match (module, name) {
        ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => {
            Ok(Function::Reconstruct)
        }
        ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Ok(Function::Scalar),
        ("numpy", "ndarray") => Ok(Function::NdArray),
        ("numpy", "dtype") => Ok(Function::Dtype),
        ("_codecs", "encode") => Ok(Function::Encode),
        _ => Err(PickleError::Unknown(format!("{module}.{name}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(bytes: &[u8]) -> String {
        Pickle::read(bytes).unwrap_err().to_string()
    }

    #[test]
    fn nothing_is_called_that_is_not_known() {
        let calls = error(b"cos\nsystem\n(S'true'\ntR.");
        assert!(calls.contains("another kind: os.system"), "{calls}");
        assert!(error(b"\x80\x04\x95").contains("cannot read"));
        assert!(error(b"R").contains("without its operands"));
        assert!(error(b"h\x07.").contains("unknown reference"));
        // More bytes than any memory holds.
        assert!(error(b"\x8e\xff\xff\xff\xff\xff\xff\xff\x7fx").contains("ends early"));
    }

    #[test]
    fn a_list_in_itself_ends() {
        let pickle = Pickle::read(&b"]\x94h\x00a."[..]).unwrap();
        assert_eq!(pickle.items(pickle.root), Some(&[pickle.root][..]));
        let deep = [&b")"[..], &vec![0x85; 1_000_000], b"."].concat();
        assert_eq!(Pickle::read(&deep[..]).unwrap().objects.len(), 1_000_001);
    }
}
