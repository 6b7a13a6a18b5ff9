//! The C functions of FMI 3.0, and all unsafe code of the crate.
//!
//! What makes it sound is the standard's contract with the importer:
//!
//! - an instance is a pointer that an `fmi3Instantiate...` function returned and
//!   `fmi3FreeInstance` has not taken back, and no two calls of one instance run at the same time;
//! - an array has as many entries as its length says; a text ends with a zero byte;
//! - a state is a pointer that `fmi3GetFMUState` or `fmi3DeserializeFMUState` wrote and
//!   `fmi3FreeFMUState` has not taken back.
//!
//! Null pointers are refused. A panic ends at this border, as `fmi3Fatal`, and nothing but
//! `fmi3FreeInstance` is answered afterwards.
#![expect(unsafe_code, reason = "C functions take pointers")]

use std::ffi::{CStr, CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::ptr;

use rover_core::quantity::legible;

use crate::refusal::Refusal;
use crate::saved::Saved;
use crate::scene_file::SceneFile;
use crate::unit::{Unit, count};

/// `fmi3Status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum Status {
    Ok = 0,
    Warning = 1,
    Error = 3,
    Fatal = 4,
}

type Text = *const c_char;
type LogMessage = Option<unsafe extern "C" fn(*mut c_void, Status, Text, Text)>;

/// The importer's place for messages.
struct Log {
    environment: *mut c_void,
    write: LogMessage,
}

impl Log {
    fn say(&self, status: Status, message: &str) {
        let category = match status {
            Status::Warning => c"logStatusWarning",
            Status::Fatal => c"logStatusFatal",
            _ => c"logStatusError",
        };
        let text = CString::new(legible(message).replace('\0', " ")).unwrap_or_default();
        if let Some(write) = self.write {
            // SAFETY: the importer's own function and environment; both texts outlive the call.
            unsafe { write(self.environment, status, category.as_ptr(), text.as_ptr()) }
        }
    }
}

/// What an `fmi3Instance` points to.
pub struct Instance {
    unit: Unit,
    log: Log,
    /// Texts that were handed out, which stay until the next call.
    texts: Vec<CString>,
    has_panicked: bool,
}

/// Answers a call: refusals and panics are logged and become a status.
///
/// SAFETY: `instance` is null or an instance of the importer's, as the module says.
unsafe fn answer(
    instance: *mut Instance,
    call: impl FnOnce(&mut Instance) -> Result<Status, Refusal>,
) -> Status {
    // SAFETY: see above; no other call holds it.
    let Some(instance) = (unsafe { instance.as_mut() }) else {
        return Status::Error;
    };
    if instance.has_panicked {
        return Status::Fatal;
    }
    match catch_unwind(AssertUnwindSafe(|| call(instance))) {
        Ok(Ok(status)) => status,
        Ok(Err(refusal)) => {
            instance.log.say(Status::Error, &refusal.to_string());
            Status::Error
        }
        Err(_) => {
            instance.has_panicked = true;
            let message = "the unit has failed and takes no more calls; please report this";
            instance.log.say(Status::Fatal, message);
            Status::Fatal
        }
    }
}

/// An array of the importer's; empty for a null pointer without entries.
///
/// SAFETY: `entries` is null or points to `n` entries.
unsafe fn slice<'a, T>(
    argument: &'static str,
    entries: *const T,
    n: usize,
) -> Result<&'a [T], Refusal> {
    match (entries.is_null(), n) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(Refusal::Null { argument }),
        // SAFETY: see above.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(entries, n) }),
    }
}

/// A writable array of the importer's; empty for a null pointer without entries.
///
/// SAFETY: as [`slice`], and nobody else holds the array during the call.
unsafe fn slice_mut<'a, T>(
    argument: &'static str,
    entries: *mut T,
    n: usize,
) -> Result<&'a mut [T], Refusal> {
    match (entries.is_null(), n) {
        (_, 0) => Ok(&mut []),
        (true, _) => Err(Refusal::Null { argument }),
        // SAFETY: see above.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts_mut(entries, n) }),
    }
}

/// A text of the importer's.
///
/// SAFETY: `text` is null or ends with a zero byte.
unsafe fn text<'a>(argument: &'static str, text: Text) -> Result<&'a str, Refusal> {
    if text.is_null() {
        return Err(Refusal::Null { argument });
    }
    // SAFETY: see above.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map_err(|_| Refusal::Text { argument })
}

/// A place of the importer's for one value.
///
/// SAFETY: `place` is null or valid for a write.
unsafe fn place<'a, T>(argument: &'static str, place: *mut T) -> Result<&'a mut T, Refusal> {
    // SAFETY: see above.
    unsafe { place.as_mut() }.ok_or(Refusal::Null { argument })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> Text {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _instance_name: Text,
    token: Text,
    resources: Text,
    _visible: bool,
    _logging_on: bool,
    _event_mode_used: bool,
    _early_return_allowed: bool,
    _required: *const u32,
    n_required: usize,
    environment: *mut c_void,
    write: LogMessage,
    _update: *const c_void,
) -> *mut Instance {
    let log = Log { environment, write };
    let make = || -> Result<Unit, Refusal> {
        if n_required > 0 {
            let call = "requiredIntermediateVariables";
            return Err(Refusal::Unsupported { call });
        }
        // SAFETY: texts of the importer's.
        let (token, resources) = unsafe {
            (
                text("instantiationToken", token)?,
                text("resourcePath", resources)?,
            )
        };
        Unit::new(SceneFile::read(Path::new(resources))?, token)
    };
    match catch_unwind(AssertUnwindSafe(make)) {
        Ok(Ok(unit)) => Box::into_raw(Box::new(Instance {
            unit,
            log,
            texts: Vec::new(),
            has_panicked: false,
        })),
        Ok(Err(refusal)) => {
            log.say(Status::Error, &refusal.to_string());
            ptr::null_mut()
        }
        Err(_) => {
            log.say(
                Status::Fatal,
                "the unit cannot be instantiated; please report this",
            );
            ptr::null_mut()
        }
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateModelExchange(
    _instance_name: Text,
    _token: Text,
    _resources: Text,
    _visible: bool,
    _logging_on: bool,
    environment: *mut c_void,
    write: LogMessage,
) -> *mut Instance {
    let call = "fmi3InstantiateModelExchange";
    Log { environment, write }.say(Status::Error, &Refusal::Unsupported { call }.to_string());
    ptr::null_mut()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateScheduledExecution(
    _instance_name: Text,
    _token: Text,
    _resources: Text,
    _visible: bool,
    _logging_on: bool,
    environment: *mut c_void,
    write: LogMessage,
    _clock_update: *const c_void,
    _lock: *const c_void,
    _unlock: *const c_void,
) -> *mut Instance {
    let call = "fmi3InstantiateScheduledExecution";
    Log { environment, write }.say(Status::Error, &Refusal::Unsupported { call }.to_string());
    ptr::null_mut()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(instance: *mut Instance) {
    if !instance.is_null() {
        // SAFETY: it came from `Box::into_raw`, and the importer gives it back.
        drop(unsafe { Box::from_raw(instance) });
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetDebugLogging(
    instance: *mut Instance,
    _logging_on: bool,
    _n_categories: usize,
    _categories: *const Text,
) -> Status {
    // SAFETY: the importer's instance. Errors are always logged, and there are no other messages.
    unsafe { answer(instance, |_| Ok(Status::Ok)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: *mut Instance,
    _tolerance_defined: bool,
    _tolerance: f64,
    start_time: f64,
    stop_time_defined: bool,
    stop_time: f64,
) -> Status {
    let stop = stop_time_defined.then_some(stop_time);
    // SAFETY: the importer's instance.
    unsafe {
        answer(instance, |it| {
            it.unit.begin(start_time, stop).map(|()| Status::Ok)
        })
    }
}

/// Functions without arguments, each a method of the unit.
macro_rules! of_unit {
    ($($name:ident: $method:ident;)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(instance: *mut Instance) -> Status {
            // SAFETY: the importer's instance.
            unsafe { answer(instance, |it| it.unit.$method().map(|()| Status::Ok)) }
        }
    )*};
}

of_unit! {
    fmi3ExitInitializationMode: begin_steps;
    fmi3Terminate: terminate;
    fmi3Reset: reset;
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DoStep(
    instance: *mut Instance,
    current_communication_point: f64,
    communication_step_size: f64,
    _no_set_state_prior: bool,
    event_handling_needed: *mut bool,
    terminate_simulation: *mut bool,
    early_return: *mut bool,
    last_successful_time: *mut f64,
) -> Status {
    // SAFETY: the importer's instance and places.
    unsafe {
        answer(instance, |it| {
            *place("eventHandlingNeeded", event_handling_needed)? = false;
            *place("terminateSimulation", terminate_simulation)? = false;
            *place("earlyReturn", early_return)? = false;
            let end = place("lastSuccessfulTime", last_successful_time)?;
            *end = it.unit.time();
            let is_solved = (it.unit).step(current_communication_point, communication_step_size)?;
            *end = it.unit.time();
            if is_solved {
                return Ok(Status::Ok);
            }
            let message = "fmi3DoStep: a contact problem was not solved to tolerance";
            it.log.say(Status::Warning, message);
            Ok(Status::Warning)
        })
    }
}

/// Reads and writes of variables, with a slice of their references and one of their values.
macro_rules! of_variables {
    ($(
        $name:ident($values:ty, $slice:ident)
        |$it:ident, $references:ident, $entries:ident| $call:expr;
    )*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            instance: *mut Instance,
            references: *const u32,
            n_references: usize,
            values: $values,
            n_values: usize,
        ) -> Status {
            // SAFETY: the importer's instance, arrays and texts.
            unsafe {
                answer(instance, |$it| {
                    let $references = slice("valueReferences", references, n_references)?;
                    let $entries = $slice("values", values, n_values)?;
                    $call.map(|()| Status::Ok)
                })
            }
        }
    )*};
}

of_variables! {
    fmi3GetFloat64(*mut f64, slice_mut) |it, references, values| it.unit.numbers(references, values);
    fmi3SetFloat64(*const f64, slice) |it, references, values| it.unit.set_numbers(references, values);
    fmi3GetString(*mut Text, slice_mut) |it, references, values| texts(it, references, values);
    fmi3SetString(*const Text, slice) |it, references, values| set_texts(it, references, values);
}

/// Hands out texts, which stay until the next call.
fn texts(it: &mut Instance, references: &[u32], values: &mut [Text]) -> Result<(), Refusal> {
    count(references.len(), values.len())?;
    it.texts.clear();
    for (&reference, value) in references.iter().zip(values) {
        let text = it.unit.text(reference)?.replace('\0', " ");
        it.texts.push(CString::new(text).unwrap_or_default());
        *value = it.texts.last().map_or(c"".as_ptr(), |text| text.as_ptr());
    }
    Ok(())
}

/// Takes over texts.
///
/// SAFETY: as [`text`].
unsafe fn set_texts(it: &mut Instance, references: &[u32], values: &[Text]) -> Result<(), Refusal> {
    count(references.len(), values.len())?;
    for (&reference, &value) in references.iter().zip(values) {
        // SAFETY: see above.
        it.unit
            .set_text(reference, unsafe { text("values", value) }?)?;
    }
    Ok(())
}

/// Writes a state over the one that a place holds, or into a new one where it holds none.
///
/// # Safety
/// The place holds null or a state.
unsafe fn hand_over(place: &mut *mut Saved, saved: Saved) {
    // SAFETY: the caller's.
    match unsafe { place.as_mut() } {
        Some(earlier) => *earlier = saved,
        None => *place = Box::into_raw(Box::new(saved)),
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetFMUState(
    instance: *mut Instance,
    state: *mut *mut Saved,
) -> Status {
    // SAFETY: the importer's instance and place, which holds null or a state.
    unsafe {
        answer(instance, |it| {
            hand_over(place("FMUState", state)?, it.unit.saved());
            Ok(Status::Ok)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetFMUState(instance: *mut Instance, state: *mut Saved) -> Status {
    // SAFETY: the importer's instance and state.
    unsafe {
        answer(instance, |it| {
            let saved = place("FMUState", state)?;
            it.unit.restore(saved).map(|()| Status::Ok)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeFMUState(
    instance: *mut Instance,
    state: *mut *mut Saved,
) -> Status {
    // SAFETY: the importer's instance, and a place that holds null or a state, which it gives back.
    unsafe {
        answer(instance, |_| {
            let place = place("FMUState", state)?;
            if !place.is_null() {
                drop(Box::from_raw(*place));
                *place = ptr::null_mut();
            }
            Ok(Status::Ok)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SerializedFMUStateSize(
    instance: *mut Instance,
    state: *mut Saved,
    size: *mut usize,
) -> Status {
    // SAFETY: the importer's instance, state and place.
    unsafe {
        answer(instance, |_| {
            *place("size", size)? = place("FMUState", state)?.to_bytes()?.len();
            Ok(Status::Ok)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SerializeFMUState(
    instance: *mut Instance,
    state: *mut Saved,
    serialized: *mut u8,
    size: usize,
) -> Status {
    // SAFETY: the importer's instance, state and array.
    unsafe {
        answer(instance, |_| {
            let bytes = place("FMUState", state)?.to_bytes()?;
            count(bytes.len(), size)?;
            slice_mut("serializedState", serialized, size)?.copy_from_slice(&bytes);
            Ok(Status::Ok)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DeserializeFMUState(
    instance: *mut Instance,
    serialized: *const u8,
    size: usize,
    state: *mut *mut Saved,
) -> Status {
    // SAFETY: the importer's instance, array and place, which holds null or a state.
    unsafe {
        answer(instance, |it| {
            let saved = Saved::from_bytes(slice("serializedState", serialized, size)?)?;
            it.unit.check(&saved)?;
            hand_over(place("FMUState", state)?, saved);
            Ok(Status::Ok)
        })
    }
}

/// Functions for other interfaces and for variables that the unit does not have.
macro_rules! unsupported {
    ($($name:ident($($argument:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(instance: *mut Instance $(, _: $argument)*) -> Status {
            // SAFETY: the importer's instance.
            unsafe {
                answer(instance, |_| Err(Refusal::Unsupported { call: stringify!($name) }))
            }
        }
    )*};
}

/// Reads and writes of types that no variable has: none of them is no error.
macro_rules! without_variables {
    ($($name:ident($($argument:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            instance: *mut Instance,
            references: *const u32,
            n_references: usize
            $(, _: $argument)*
        ) -> Status {
            // SAFETY: the importer's instance and array.
            unsafe {
                answer(instance, |_| match slice("valueReferences", references, n_references)? {
                    [] => Ok(Status::Ok),
                    [reference, ..] => Err(Refusal::NoVariable { reference: *reference }),
                })
            }
        }
    )*};
}

type Any = *mut c_void;

without_variables! {
    fmi3GetFloat32(Any, usize);
    fmi3GetInt8(Any, usize);
    fmi3GetUInt8(Any, usize);
    fmi3GetInt16(Any, usize);
    fmi3GetUInt16(Any, usize);
    fmi3GetInt32(Any, usize);
    fmi3GetUInt32(Any, usize);
    fmi3GetInt64(Any, usize);
    fmi3GetUInt64(Any, usize);
    fmi3GetBoolean(Any, usize);
    fmi3GetBinary(Any, Any, usize);
    fmi3GetClock(Any);
    fmi3SetFloat32(Any, usize);
    fmi3SetInt8(Any, usize);
    fmi3SetUInt8(Any, usize);
    fmi3SetInt16(Any, usize);
    fmi3SetUInt16(Any, usize);
    fmi3SetInt32(Any, usize);
    fmi3SetUInt32(Any, usize);
    fmi3SetInt64(Any, usize);
    fmi3SetUInt64(Any, usize);
    fmi3SetBoolean(Any, usize);
    fmi3SetBinary(Any, Any, usize);
    fmi3SetClock(Any);
    fmi3GetIntervalDecimal(Any, Any);
    fmi3GetIntervalFraction(Any, Any, Any);
    fmi3GetShiftDecimal(Any);
    fmi3GetShiftFraction(Any, Any);
    fmi3SetIntervalDecimal(Any);
    fmi3SetIntervalFraction(Any, Any);
    fmi3SetShiftDecimal(Any);
    fmi3SetShiftFraction(Any, Any);
    fmi3GetOutputDerivatives(Any, Any, usize);
}

unsupported! {
    fmi3EnterEventMode();
    fmi3EnterStepMode();
    fmi3EnterConfigurationMode();
    fmi3ExitConfigurationMode();
    fmi3EvaluateDiscreteStates();
    fmi3UpdateDiscreteStates(Any, Any, Any, Any, Any, Any);
    fmi3GetNumberOfVariableDependencies(u32, Any);
    fmi3GetVariableDependencies(u32, Any, Any, Any, Any, usize);
    fmi3GetDirectionalDerivative(Any, usize, Any, usize, Any, usize, Any, usize);
    fmi3GetAdjointDerivative(Any, usize, Any, usize, Any, usize, Any, usize);
    fmi3EnterContinuousTimeMode();
    fmi3CompletedIntegratorStep(bool, Any, Any);
    fmi3SetTime(f64);
    fmi3SetContinuousStates(Any, usize);
    fmi3GetContinuousStateDerivatives(Any, usize);
    fmi3GetEventIndicators(Any, usize);
    fmi3GetContinuousStates(Any, usize);
    fmi3GetNominalsOfContinuousStates(Any, usize);
    fmi3GetNumberOfEventIndicators(Any);
    fmi3GetNumberOfContinuousStates(Any);
    fmi3ActivateModelPartition(u32, f64);
}
