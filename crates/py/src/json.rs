//! What serialises, as plain Python values. Unlike JSON it keeps infinities and NaN.

use pyo3::BoundObject;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde::ser::{
    self, Impossible, Serialize, SerializeMap, SerializeSeq, SerializeStruct, SerializeTuple,
    SerializeTupleStruct, Serializer,
};

/// Dicts, lists, numbers, text.
pub fn to_python<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    value.serialize(Plain(py)).map_err(|error| error.0)
}

/// An exception while values are made.
#[derive(Debug)]
pub struct Raised(PyErr);

impl std::fmt::Display for Raised {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for Raised {}

impl ser::Error for Raised {
    fn custom<T: std::fmt::Display>(message: T) -> Self {
        Self(crate::errors::value(message.to_string()))
    }
}

impl From<PyErr> for Raised {
    fn from(error: PyErr) -> Self {
        Self(error)
    }
}

type Made<'py> = Result<Bound<'py, PyAny>, Raised>;

#[derive(Clone, Copy)]
struct Plain<'py>(Python<'py>);

impl<'py> Plain<'py> {
    fn of<T: IntoPyObject<'py>>(self, value: T) -> Made<'py> {
        let made = value.into_pyobject(self.0).map_err(Into::into)?;
        Ok(made.into_any().into_bound())
    }
}

/// A list or a dict in the making.
struct Many<'py> {
    py: Plain<'py>,
    list: Bound<'py, PyList>,
    dict: Bound<'py, PyDict>,
    key: Option<Bound<'py, PyAny>>,
}

impl<'py> Many<'py> {
    fn new(py: Plain<'py>) -> Self {
        Self {
            py,
            list: PyList::empty(py.0),
            dict: PyDict::new(py.0),
            key: None,
        }
    }
}

macro_rules! plain {
    ($($method:ident: $kind:ty),+ $(,)?) => {
        $( fn $method(self, value: $kind) -> Made<'py> { self.of(value) } )+
    };
}

impl<'py> Serializer for Plain<'py> {
    type Ok = Bound<'py, PyAny>;
    type Error = Raised;
    type SerializeSeq = Many<'py>;
    type SerializeTuple = Many<'py>;
    type SerializeTupleStruct = Many<'py>;
    type SerializeTupleVariant = Impossible<Self::Ok, Raised>;
    type SerializeMap = Many<'py>;
    type SerializeStruct = Many<'py>;
    type SerializeStructVariant = Impossible<Self::Ok, Raised>;

    plain! {
        serialize_bool: bool,
        serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64,
        serialize_f32: f32, serialize_f64: f64,
        serialize_char: char, serialize_str: &str,
    }

    fn serialize_bytes(self, value: &[u8]) -> Made<'py> {
        Ok(pyo3::types::PyBytes::new(self.0, value).into_any())
    }

    fn serialize_none(self) -> Made<'py> {
        Ok(self.0.None().into_bound(self.0))
    }

    fn serialize_some<T: ?Sized + Serialize>(self, value: &T) -> Made<'py> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Made<'py> {
        self.serialize_none()
    }

    fn serialize_unit_struct(self, _: &'static str) -> Made<'py> {
        self.serialize_none()
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, name: &'static str) -> Made<'py> {
        self.of(name)
    }

    fn serialize_newtype_struct<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        value: &T,
    ) -> Made<'py> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        _: u32,
        name: &'static str,
        value: &T,
    ) -> Made<'py> {
        let dict = PyDict::new(self.0);
        dict.set_item(name, value.serialize(self)?)?;
        Ok(dict.into_any())
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Many<'py>, Raised> {
        Ok(Many::new(self))
    }

    fn serialize_tuple(self, _: usize) -> Result<Many<'py>, Raised> {
        Ok(Many::new(self))
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Many<'py>, Raised> {
        Ok(Many::new(self))
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        name: &'static str,
        _: usize,
    ) -> Result<Self::SerializeTupleVariant, Raised> {
        Err(ser::Error::custom(format!("{name} has no plain form")))
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Many<'py>, Raised> {
        Ok(Many::new(self))
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Many<'py>, Raised> {
        Ok(Many::new(self))
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        name: &'static str,
        _: usize,
    ) -> Result<Self::SerializeStructVariant, Raised> {
        Err(ser::Error::custom(format!("{name} has no plain form")))
    }
}

impl<'py> SerializeSeq for Many<'py> {
    type Ok = Bound<'py, PyAny>;
    type Error = Raised;

    fn serialize_element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Raised> {
        Ok(self.list.append(value.serialize(self.py)?)?)
    }

    fn end(self) -> Made<'py> {
        Ok(self.list.into_any())
    }
}

impl<'py> SerializeTuple for Many<'py> {
    type Ok = Bound<'py, PyAny>;
    type Error = Raised;

    fn serialize_element<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Raised> {
        SerializeSeq::serialize_element(self, value)
    }

    fn end(self) -> Made<'py> {
        SerializeSeq::end(self)
    }
}

impl<'py> SerializeTupleStruct for Many<'py> {
    type Ok = Bound<'py, PyAny>;
    type Error = Raised;

    fn serialize_field<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Raised> {
        SerializeSeq::serialize_element(self, value)
    }

    fn end(self) -> Made<'py> {
        SerializeSeq::end(self)
    }
}

impl<'py> SerializeMap for Many<'py> {
    type Ok = Bound<'py, PyAny>;
    type Error = Raised;

    fn serialize_key<T: ?Sized + Serialize>(&mut self, key: &T) -> Result<(), Raised> {
        self.key = Some(key.serialize(self.py)?);
        Ok(())
    }

    fn serialize_value<T: ?Sized + Serialize>(&mut self, value: &T) -> Result<(), Raised> {
        let key = self.key.take();
        Ok(self.dict.set_item(key, value.serialize(self.py)?)?)
    }

    fn end(self) -> Made<'py> {
        Ok(self.dict.into_any())
    }
}

impl<'py> SerializeStruct for Many<'py> {
    type Ok = Bound<'py, PyAny>;
    type Error = Raised;

    fn serialize_field<T: ?Sized + Serialize>(
        &mut self,
        name: &'static str,
        value: &T,
    ) -> Result<(), Raised> {
        Ok(self.dict.set_item(name, value.serialize(self.py)?)?)
    }

    fn end(self) -> Made<'py> {
        Ok(self.dict.into_any())
    }
}
