//! Arguments as they were given, read strictly: what is no number, no count
//! or no flag is refused under its name.
//!
//! A number is a float, an integer, or what numpy or Python hold to be real; a truth value, a
//! complex number, a time and a text are none, though `float()` or numpy would take some of them.

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyInt, PyString};

use crate::errors::{BorderError, Kind, Value};

/// Longest piece of a value that a message shows.
const SHOWN: usize = 80;

/// An argument that may be missing; the type of a parameter that no conversion has refused yet.
pub struct Given<'py>(Option<Bound<'py, PyAny>>);

impl<'py> FromPyObject<'_, 'py> for Given<'py> {
    type Error = std::convert::Infallible;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> Result<Self, Self::Error> {
        Ok(Self(Some(given.to_owned())))
    }
}

impl<'py> Given<'py> {
    /// A parameter's default.
    pub const MISSING: Self = Self(None);

    /// What was given; nothing where that is `None` or missing.
    pub fn some(self) -> Option<Bound<'py, PyAny>> {
        self.0.filter(|given| !given.is_none())
    }

    /// What was given, be it `None`; nothing where it is missing.
    pub fn given(self) -> Option<Bound<'py, PyAny>> {
        self.0
    }

    /// A number.
    pub fn number(self, default: f64, kind: Kind, field: &str) -> PyResult<f64> {
        self.0
            .map_or(Ok(default), |given| number(&given, kind, field))
    }

    /// A number, or nothing where `None` was given.
    pub fn maybe(self, kind: Kind, field: &str) -> PyResult<Option<f64>> {
        self.some()
            .map(|given| number(&given, kind, field))
            .transpose()
    }

    /// A whole number that is not negative.
    pub fn whole(self, default: u64, kind: Kind, field: &str) -> PyResult<u64> {
        self.0
            .map_or(Ok(default), |given| whole(&given, kind, field))
    }

    /// A count.
    pub fn count(self, default: usize, kind: Kind, field: &str) -> PyResult<usize> {
        self.0
            .map_or(Ok(default), |given| count(&given, kind, field))
    }

    /// A truth value.
    pub fn flag(self, default: bool, kind: Kind, field: &str) -> PyResult<bool> {
        self.0
            .map_or(Ok(default), |given| flag(&given, kind, field))
    }

    /// A text.
    pub fn text(self, default: &str, kind: Kind, field: &str) -> PyResult<String> {
        self.0
            .map_or_else(|| Ok(default.to_owned()), |given| text(&given, kind, field))
    }

    /// An object of a class, or nothing where `None` was given. `what`: its name with an article.
    pub fn object<T>(self, kind: Kind, field: &str, what: &str) -> PyResult<Option<T>>
    where
        T: for<'a> FromPyObject<'a, 'py>,
    {
        let read = |given: Bound<'py, PyAny>| {
            let found = given.extract::<T>();
            found.map_err(|_| refused(&given, kind, field, what).into())
        };
        self.some().map(read).transpose()
    }
}

/// How a value looks in a message.
pub fn shown(value: &Bound<'_, PyAny>) -> String {
    let Ok(repr) = value.repr() else {
        return value.get_type().to_string();
    };
    let repr = repr.to_string();
    if repr.chars().count() <= SHOWN {
        return repr;
    }
    repr.chars().take(SHOWN).chain("…".chars()).collect()
}

/// The error of a value that is not what it must be.
pub fn refused(value: &Bound<'_, PyAny>, kind: Kind, field: &str, what: &str) -> BorderError {
    BorderError {
        kind,
        message: format!("{field}: must be {what}, is {}", shown(value)),
        field: Some(field.to_owned()),
        value: Value::Object(value.clone().unbind()),
    }
}

/// The letter of numpy's kind (`dtype.kind`) of a scalar or of an array of no dimension.
fn scalar_kind(value: &Bound<'_, PyAny>) -> Option<char> {
    let letter = value.getattr("dtype").and_then(|d| d.getattr("kind"));
    let letter = letter.and_then(|k| k.extract::<char>()).ok()?;
    let dimensions = value.getattr("ndim").and_then(|n| n.extract::<usize>());
    (dimensions.ok()? == 0).then_some(letter)
}

/// A number: real, and within a double's range.
pub fn number(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<f64> {
    if let Ok(x) = value.cast_exact::<PyFloat>() {
        return Ok(x.value());
    }
    let is_other = value.is_instance_of::<PyBool>()
        || value.is_instance_of::<PyString>()
        || scalar_kind(value).is_some_and(|k| !"fiu".contains(k));
    if is_other {
        return Err(refused(value, kind, field, "a number").into());
    }
    let found = value.extract::<f64>();
    let is_huge = value.is_instance_of::<PyInt>();
    found.map_err(|_| {
        let what = if is_huge {
            "a number that a double can hold"
        } else {
            "a number"
        };
        refused(value, kind, field, what).into()
    })
}

/// A whole number that is not negative.
pub fn whole(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<u64> {
    if let Ok(plain) = value.cast_exact::<PyInt>()
        && let Ok(count) = plain.extract()
    {
        return Ok(count);
    }
    let is_whole = match scalar_kind(value) {
        Some(letter) => "iu".contains(letter),
        None => value.is_instance_of::<PyInt>() && !value.is_instance_of::<PyBool>(),
    };
    if !is_whole {
        return Err(refused(value, kind, field, "a whole number").into());
    }
    value.extract::<u64>().map_err(|_| {
        let what = if value.lt(0).unwrap_or(false) {
            "a number that is not negative"
        } else {
            "below 2^64"
        };
        refused(value, kind, field, what).into()
    })
}

/// A whole number of things.
pub fn count(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<usize> {
    let n = whole(value, kind, field)?;
    usize::try_from(n).map_err(|_| refused(value, kind, field, "smaller").into())
}

/// A count of at least one.
pub fn at_least_one(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<usize> {
    match count(value, kind, field)? {
        0 => Err(refused(value, kind, field, "at least 1").into()),
        n => Ok(n),
    }
}

/// A truth value.
pub fn flag(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<bool> {
    let is_flag = value.is_instance_of::<PyBool>() || scalar_kind(value) == Some('b');
    let found = is_flag.then(|| value.is_truthy()).transpose()?;
    found.ok_or_else(|| refused(value, kind, field, "True or False").into())
}

/// A text.
pub fn text(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<String> {
    let found = value.extract::<String>();
    found.map_err(|_| refused(value, kind, field, "a text").into())
}

/// Truth values (n,).
pub fn flags(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<Vec<bool>> {
    let entries = value
        .try_iter()
        .map_err(|_| refused(value, kind, field, "truth values"))?;
    entries
        .enumerate()
        .map(|(i, entry)| flag(&entry?, kind, &format!("{field}[{i}]")))
        .collect()
}

/// Texts, or one.
pub fn texts(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<Vec<String>> {
    if let Ok(one) = value.extract::<String>() {
        return Ok(vec![one]);
    }
    let entries = value
        .try_iter()
        .map_err(|_| refused(value, kind, field, "a name or names"))?;
    entries
        .enumerate()
        .map(|(i, entry)| text(&entry?, kind, &format!("{field}[{i}]")))
        .collect()
}
