//! Arguments as they were given, read strictly: what is no number, no count
//! or no flag is refused under its name.
//!
//! A number is a float, an integer, or what numpy or Python hold to be real; a truth value, a
//! complex number, a time and a text are none, though `float()` or numpy would take some of them.

use pyo3::PyTypeCheck;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyMapping, PyString};

use crate::errors::{BorderError, Kind, Result, Value};

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

    /// A number, or nothing where `None` was given.
    pub fn maybe(self, kind: Kind, field: &str) -> Result<Option<f64>> {
        self.some()
            .map(|given| number(&given, kind, field))
            .transpose()
    }

    /// An object of a class, or nothing where `None` was given. `what`: its name with an article.
    pub fn object<T>(self, kind: Kind, field: &str, what: &str) -> Result<Option<T>>
    where
        T: for<'a> FromPyObject<'a, 'py>,
    {
        let read = |given: Bound<'py, PyAny>| {
            let found = given.extract::<T>();
            found.map_err(|_| refused(&given, kind, field, what))
        };
        self.some().map(read).transpose()
    }
}

/// An object of a class. `what`: its name with an article.
pub fn object<'a, 'py, T: PyTypeCheck>(
    given: &'a Bound<'py, PyAny>,
    kind: Kind,
    field: &str,
    what: &str,
) -> Result<&'a Bound<'py, T>> {
    given.cast().map_err(|_| refused(given, kind, field, what))
}

/// The entries of an iterable, as a function reads them. `what`: all of them.
pub fn each<'py, T>(
    value: &Bound<'py, PyAny>,
    kind: Kind,
    (field, what): (&str, &str),
    read: impl Fn(&Bound<'py, PyAny>, Kind, &str) -> Result<T>,
) -> Result<Vec<T>> {
    let entries = value.try_iter();
    let entries = entries.map_err(|_| refused(value, kind, field, what))?;
    let numbered = entries.enumerate();
    numbered
        .map(|(i, entry)| read(&entry?, kind, &format!("{field}[{i}]")))
        .collect()
}

/// Whether an argument is a text or an `os.PathLike`.
pub fn is_path(given: &Bound<'_, PyAny>) -> Result<bool> {
    Ok(given.is_instance_of::<PyString>() || given.hasattr("__fspath__")?)
}

/// Values by name: keyword arguments, or a mapping that was given as one argument.
pub struct Named<'py> {
    given: Bound<'py, PyMapping>,
    /// Name of the argument that is the mapping; none of keyword arguments.
    outer: Option<&'static str>,
    kind: Kind,
}

impl<'py> Named<'py> {
    /// Keyword arguments, each of which is read once. Those left at [`Self::finish`] are unknown.
    pub fn keywords(py: Python<'py>, given: Option<&Bound<'py, PyDict>>) -> Result<Self> {
        let given = given.map_or_else(|| Ok(PyDict::new(py)), pyo3::types::PyDictMethods::copy)?;
        Ok(Self {
            given: given.into_mapping(),
            outer: None,
            kind: Kind::Option,
        })
    }

    /// A mapping that is the argument `outer`.
    pub fn mapping(given: &Bound<'py, PyAny>, outer: &'static str, kind: Kind) -> Result<Self> {
        Ok(Self {
            given: object(given, kind, outer, "a mapping")?.clone(),
            outer: Some(outer),
            kind,
        })
    }

    /// The values by name, with errors of another kind.
    pub fn of(&self, kind: Kind) -> Self {
        Self {
            given: self.given.clone(),
            outer: self.outer,
            kind,
        }
    }

    /// Raises an error for arguments that have not been read.
    pub fn finish(self) -> Result<()> {
        match self.given.try_iter()?.next() {
            None => Ok(()),
            Some(name) => {
                let message = format!("got an unexpected keyword argument {}", name?.repr()?);
                Err(PyTypeError::new_err(message).into())
            }
        }
    }

    /// Full name of a value.
    pub fn path(&self, name: &str) -> String {
        self.outer
            .map_or_else(|| name.to_owned(), |outer| format!("{outer}.{name}"))
    }

    /// The error for an invalid value.
    pub fn refused(&self, value: &Bound<'_, PyAny>, name: &str, what: &str) -> BorderError {
        refused(value, self.kind, &self.path(name), what)
    }

    /// A value, be it `None`.
    pub fn get(&self, name: &str) -> Result<Given<'py>> {
        if !self.given.contains(name)? {
            return Ok(Given::MISSING);
        }
        let value = self.given.get_item(name)?;
        if self.outer.is_none() {
            self.given.del_item(name)?;
        }
        Ok(Given(Some(value)))
    }

    /// A value that is there and not `None`.
    pub fn some(&self, name: &str) -> Result<Option<Bound<'py, PyAny>>> {
        Ok(self.get(name)?.some())
    }

    /// What a function reads of a value, nothing where that is missing or `None`.
    pub fn read<T>(
        &self,
        name: &str,
        read: impl FnOnce(&Bound<'py, PyAny>, Kind, &str) -> Result<T>,
    ) -> Result<Option<T>> {
        let path = self.path(name);
        self.some(name)?
            .map(|value| read(&value, self.kind, &path))
            .transpose()
    }

    /// What a function reads of a value that must be given.
    pub fn need<T>(
        &self,
        name: &str,
        read: impl FnOnce(&Bound<'py, PyAny>, Kind, &str) -> Result<T>,
    ) -> Result<T> {
        let missing = || match self.outer {
            None => {
                let message = format!("missing a required keyword argument: '{name}'");
                PyTypeError::new_err(message).into()
            }
            Some(_) => refused(self.given.as_any(), self.kind, &self.path(name), "given"),
        };
        let value = self.get(name)?.given().ok_or_else(missing)?;
        read(&value, self.kind, &self.path(name))
    }

    /// A number, or nothing where it is missing or `None`.
    pub fn maybe(&self, name: &str) -> Result<Option<f64>> {
        self.get(name)?.maybe(self.kind, &self.path(name))
    }
}

/// Methods that read an argument as the function of their name, with a default.
macro_rules! readers {
    ($($read:ident: $type:ty),+) => {
        impl Given<'_> {
            $(
                /// The value, or the default where it is missing.
                pub fn $read(self, default: $type, kind: Kind, field: &str) -> Result<$type> {
                    self.0.map_or(Ok(default), |given| $read(&given, kind, field))
                }
            )+
        }

        impl Named<'_> {
            $(
                /// The value, or the default where it is missing.
                pub fn $read(&self, name: &str, default: $type) -> Result<$type> {
                    self.get(name)?.$read(default, self.kind, &self.path(name))
                }
            )+
        }
    };
}
readers!(number: f64, whole: u64, count: usize, flag: bool);

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

/// The error for an invalid value.
pub fn refused(value: &Bound<'_, PyAny>, kind: Kind, field: &str, what: &str) -> BorderError {
    kind.error(
        field,
        format!("{field}: must be {what}, is {}", shown(value)),
        Value::Object(value.clone().unbind()),
    )
}

/// The letter of numpy's kind (`dtype.kind`) of a scalar or of an array of no dimension.
fn scalar_kind(value: &Bound<'_, PyAny>) -> Option<char> {
    let letter = value.getattr("dtype").and_then(|d| d.getattr("kind"));
    let letter = letter.and_then(|k| k.extract::<char>()).ok()?;
    let dimensions = value.getattr("ndim").and_then(|n| n.extract::<usize>());
    (dimensions.ok()? == 0).then_some(letter)
}

/// A number: real, and within a double's range.
pub fn number(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<f64> {
    if let Ok(x) = value.cast_exact::<PyFloat>() {
        return Ok(x.value());
    }
    let is_other = value.is_instance_of::<PyBool>()
        || value.is_instance_of::<PyString>()
        || scalar_kind(value).is_some_and(|k| !"fiu".contains(k));
    if is_other {
        return Err(refused(value, kind, field, "a number"));
    }
    let found = value.extract::<f64>();
    let is_huge = value.is_instance_of::<PyInt>();
    found.map_err(|_| {
        let what = if is_huge {
            "a number that a double can hold"
        } else {
            "a number"
        };
        refused(value, kind, field, what)
    })
}

/// A finite number.
pub fn finite(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<f64> {
    match number(value, kind, field)? {
        found if found.is_finite() => Ok(found),
        _ => Err(refused(value, kind, field, "finite")),
    }
}

/// A finite number above 0.
pub fn positive(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<f64> {
    match finite(value, kind, field)? {
        found if found > 0.0 => Ok(found),
        _ => Err(refused(value, kind, field, "positive")),
    }
}

/// A whole number that is not negative.
pub fn whole(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<u64> {
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
        return Err(refused(value, kind, field, "a whole number"));
    }
    value.extract::<u64>().map_err(|_| {
        let what = if value.lt(0).unwrap_or(false) {
            "a number that is not negative"
        } else {
            "below 2^64"
        };
        refused(value, kind, field, what)
    })
}

/// A whole number of things.
pub fn count(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<usize> {
    let n = whole(value, kind, field)?;
    usize::try_from(n).map_err(|_| refused(value, kind, field, "below 2^32"))
}

/// An index among `len` things.
pub fn below(index: &Bound<'_, PyAny>, len: usize) -> Result<usize> {
    match count(index, Kind::Option, "index")? {
        i if i < len => Ok(i),
        _ => Err(refused(
            index,
            Kind::Option,
            "index",
            &format!("below {len}"),
        )),
    }
}

/// A count of at least one.
pub fn at_least_one(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<usize> {
    match count(value, kind, field)? {
        0 => Err(refused(value, kind, field, "at least 1")),
        n => Ok(n),
    }
}

/// A number of threads, if one is given.
pub fn threads(given: Option<&Bound<'_, PyAny>>) -> Result<Option<usize>> {
    given
        .map(|given| at_least_one(given, Kind::Option, "threads"))
        .transpose()
}

/// A truth value.
pub fn flag(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<bool> {
    let is_flag = value.is_instance_of::<PyBool>() || scalar_kind(value) == Some('b');
    let found = is_flag.then(|| value.is_truthy()).transpose()?;
    found.ok_or_else(|| refused(value, kind, field, "True or False"))
}

/// A text.
pub fn text(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<String> {
    let found = value.extract::<String>();
    found.map_err(|_| refused(value, kind, field, "a string"))
}

/// Truth values (n,).
pub fn flags(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<Vec<bool>> {
    each(value, kind, (field, "booleans"), flag)
}

/// Texts, or one.
pub fn texts(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<Vec<String>> {
    if let Ok(one) = value.extract::<String>() {
        return Ok(vec![one]);
    }
    each(value, kind, (field, "a name or names"), text)
}
