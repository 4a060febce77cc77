//! The common part of the C functions of both standards: pointers are checked, panics are caught, errors go to the importer's logger.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

use hapt_model::LARGEST_SOURCE;

use crate::Version;
use crate::instance::{Instance, Saved};
use crate::log::{Log, Status};
use crate::model::{Model, WORLD};
use crate::variable::Value;

/// The object behind a pointer of an importer.
pub struct Component {
    pub instance: Instance,
    /// The texts of the last call that returned any: their pointers hold until the next one.
    texts: Vec<CString>,
    /// A panic has been caught: only freeing is allowed.
    is_dead: bool,
}

/// Makes an instance; null if that fails. An error of `make` goes to the log.
pub fn instantiate(log: Log, make: impl FnOnce() -> Result<Model, String>) -> *mut c_void {
    let mut log = Some(log);
    let made = catch_unwind(AssertUnwindSafe(|| {
        let model = make().map_err(|message| say(&mut log, &message))?;
        let own = log.take().ok_or(())?;
        Instance::new(model, own).map_err(|_| ())
    }));
    match made {
        Ok(Ok(instance)) => {
            Box::into_raw(Box::new(Component { instance, texts: Vec::new(), is_dead: false })).cast::<c_void>()
        }
        Ok(Err(())) => std::ptr::null_mut(),
        Err(_) => {
            say(&mut log, "a defect of hapt: the world cannot be instantiated");
            std::ptr::null_mut()
        }
    }
}

fn say(log: &mut Option<Log>, message: &str) {
    if let Some(log) = log {
        log.say(Status::Error, message);
    }
}

/// The model of an FMU's resources.
///
/// # Errors
/// In a sentence: there is no world, or it has another token.
pub fn open(version: Version, token: &str, resources: PathBuf) -> Result<Model, String> {
    let path = resources.join(WORLD);
    let size = std::fs::metadata(&path).map(|file| file.len());
    let text = match size {
        Ok(size) if size > LARGEST_SOURCE => Err(format!("{} is larger than 1 MiB", path.display())),
        _ => std::fs::read_to_string(&path).map_err(|error| format!("cannot read {}: {error}", path.display())),
    };
    Model::open(version, token, text?)
}

/// The folder that a URI of FMI 2.0 names: `file:///tmp/fmu/resources`. A plain path is accepted too.
///
/// # Errors
/// In a sentence: a URI of another scheme.
pub fn folder(uri: &str) -> Result<PathBuf, String> {
    let Some(rest) = uri.strip_prefix("file:") else {
        return match uri.contains("://") {
            true => Err(format!("the resources are at {uri:?}; only file: URIs can be read")),
            false => Ok(PathBuf::from(uri)),
        };
    };
    // file:///p, file://localhost/p and file:/p are one path; file:///C:/p is C:/p.
    let path = rest.strip_prefix("//").map_or(rest, |rest| rest.find('/').map_or(rest, |slash| &rest[slash..]));
    let path = decoded(path);
    let has_drive = path.len() > 2 && path.starts_with('/') && path.as_bytes()[2] == b':';
    Ok(PathBuf::from(if has_drive { &path[1..] } else { &path[..] }))
}

/// Percent-encoded bytes such as %20, decoded.
fn decoded(text: &str) -> String {
    let (mut bytes, mut rest) = (Vec::new(), text.as_bytes());
    while let [first, tail @ ..] = rest {
        let code = tail.get(..2).and_then(|digits| std::str::from_utf8(digits).ok());
        match code.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) if *first == b'%' => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            _ => {
                bytes.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Frees an instance of [`instantiate`].
///
/// # Safety
/// Null, or a pointer of [`instantiate`] that has not been freed.
pub unsafe fn free(component: *mut c_void) {
    if !component.is_null() {
        // SAFETY: as promised by the caller.
        let component = unsafe { Box::from_raw(component.cast::<Component>()) };
        let _ = catch_unwind(AssertUnwindSafe(|| drop(component)));
    }
}

/// A call of an instance: its error, or a panic, goes to the importer's logger.
///
/// # Safety
/// Null, or a pointer of [`instantiate`] that has not been freed, used by one thread at a time.
pub unsafe fn call(
    component: *mut c_void,
    name: &str,
    body: impl FnOnce(&mut Component) -> Result<(), String>,
) -> Status {
    // SAFETY: as promised by the caller.
    let Some(component) = (unsafe { component.cast::<Component>().as_mut() }) else { return Status::Error };
    if component.is_dead {
        return Status::Fatal;
    }
    match catch_unwind(AssertUnwindSafe(|| body(component))) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(message)) => {
            component.instance.log.say(Status::Error, &format!("{name}: {message}"));
            Status::Error
        }
        Err(_) => {
            component.is_dead = true;
            component.instance.log.say(Status::Fatal, &format!("{name}: a defect of hapt; free this instance"));
            Status::Fatal
        }
    }
}

/// The text at a pointer.
///
/// # Errors
/// Null, or not UTF-8.
///
/// # Safety
/// Null, or a text that ends with a NUL, for as long as `'a`.
pub unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, String> {
    if pointer.is_null() {
        return Err(format!("{what} is null"));
    }
    // SAFETY: as promised by the caller.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| format!("{what} is not UTF-8"))
}

/// `count` values at a pointer.
///
/// # Errors
/// A null or unaligned pointer, with a count above 0.
///
/// # Safety
/// Null, or this many values, for as long as `'a`.
pub unsafe fn slice<'a, T>(pointer: *const T, count: usize, what: &str) -> Result<&'a [T], String> {
    fits(pointer, count, what)?;
    // SAFETY: neither null nor unaligned nor too long; the rest as promised by the caller.
    Ok(if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(pointer, count) } })
}

/// The same for writing.
///
/// # Errors
/// As [`slice`].
///
/// # Safety
/// As [`slice`], and no other code reads or writes them.
pub unsafe fn slice_mut<'a, T>(pointer: *mut T, count: usize, what: &str) -> Result<&'a mut [T], String> {
    fits(pointer, count, what)?;
    // SAFETY: as in `slice`.
    Ok(if count == 0 { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(pointer, count) } })
}

fn fits<T>(pointer: *const T, count: usize, what: &str) -> Result<(), String> {
    if count == 0 {
        return Ok(());
    }
    if pointer.is_null() {
        return Err(format!("{what} is null, and must have {count} values"));
    }
    if !pointer.is_aligned() || count > isize::MAX as usize / size_of::<T>().max(1) {
        return Err(format!("{what} is no array of {count} values"));
    }
    Ok(())
}

/// Writes a value to the importer's place for it, unless the pointer is null.
///
/// # Safety
/// Null, or a place for a value.
pub unsafe fn put<T>(place: *mut T, value: T) {
    if !place.is_null() && place.is_aligned() {
        // SAFETY: as promised by the caller.
        unsafe { place.write(value) };
    }
}

/// An array of texts.
///
/// # Errors
/// As [`text`] and [`slice`].
///
/// # Safety
/// As [`text`] and [`slice`].
pub unsafe fn texts(pointer: *const *const c_char, count: usize, what: &str) -> Result<Vec<String>, String> {
    // SAFETY: as promised by the caller.
    let pointers = unsafe { slice(pointer, count, what) }?;
    // SAFETY: as promised by the caller.
    pointers.iter().map(|pointer| unsafe { text(*pointer, what) }.map(str::to_string)).collect()
}

/// Numbers of a type of C, and their values.
pub trait Number: Copy {
    /// The value to set.
    fn value(self) -> Value;
    /// The number of a value; `None` for a value of another type.
    fn number(value: &Value) -> Option<Self>;
    /// The type's name.
    const NAME: &'static str;
}

impl Number for f64 {
    const NAME: &'static str = "Real (Float64)";
    fn value(self) -> Value {
        Value::Real(self)
    }
    fn number(value: &Value) -> Option<f64> {
        match value {
            Value::Real(number) => Some(*number),
            Value::Whole(_) | Value::Text(_) => None,
        }
    }
}

impl Number for i64 {
    const NAME: &'static str = "Int64";
    fn value(self) -> Value {
        Value::Whole(self)
    }
    fn number(value: &Value) -> Option<i64> {
        match value {
            Value::Whole(number) => Some(*number),
            Value::Real(_) | Value::Text(_) => None,
        }
    }
}

impl Number for i32 {
    const NAME: &'static str = "Integer";
    fn value(self) -> Value {
        Value::Whole(self.into())
    }
    fn number(value: &Value) -> Option<i32> {
        i64::number(value)?.try_into().ok()
    }
}

/// Reads numbers into `values`: all of them, or none on an error.
///
/// # Safety
/// `references` and `values` as [`slice`].
pub unsafe fn get<T: Number>(
    component: &mut Component,
    references: *const u32,
    count: usize,
    values: *mut T,
) -> Result<(), String> {
    // SAFETY: as promised by the caller.
    let (references, places) = unsafe { (slice(references, count, "vr")?, slice_mut(values, count, "value")?) };
    let mut numbers = Vec::with_capacity(count);
    for reference in references {
        let value = component.instance.get(*reference)?;
        let name = &component.instance.variable(*reference)?.name;
        numbers.push(T::number(&value).ok_or_else(|| format!("{name} is no {}, but {value}", T::NAME))?);
    }
    places.copy_from_slice(&numbers);
    Ok(())
}

/// Sets numbers: all of them, or none on an error.
///
/// # Safety
/// As [`get`].
pub unsafe fn set<T: Number>(
    component: &mut Component,
    references: *const u32,
    count: usize,
    values: *const T,
) -> Result<(), String> {
    // SAFETY: as promised by the caller.
    let (references, values) = unsafe { (slice(references, count, "vr")?, slice(values, count, "value")?) };
    let pairs: Vec<_> = references.iter().zip(values).map(|(reference, value)| (*reference, value.value())).collect();
    component.instance.set(&pairs)
}

/// Reads texts; their pointers hold until the next call that reads texts.
///
/// # Safety
/// As [`get`].
pub unsafe fn get_texts(
    component: &mut Component,
    references: *const u32,
    count: usize,
    values: *mut *const c_char,
) -> Result<(), String> {
    // SAFETY: as promised by the caller.
    let (references, places) = unsafe { (slice(references, count, "vr")?, slice_mut(values, count, "value")?) };
    let mut read = Vec::with_capacity(count);
    for reference in references {
        let value = component.instance.get(*reference)?;
        let name = &component.instance.variable(*reference)?.name;
        let Value::Text(text) = value else { return Err(format!("{name} is no String, but {value}")) };
        read.push(CString::new(text).map_err(|_| format!("{name} has a NUL"))?);
    }
    component.texts = read;
    places.iter_mut().zip(&component.texts).for_each(|(place, text)| *place = text.as_ptr());
    Ok(())
}

/// Sets texts.
///
/// # Safety
/// As [`get`].
pub unsafe fn set_texts(
    component: &mut Component,
    references: *const u32,
    count: usize,
    values: *const *const c_char,
) -> Result<(), String> {
    // SAFETY: as promised by the caller.
    let (references, texts) = unsafe { (slice(references, count, "vr")?, texts(values, count, "value")?) };
    let pairs: Vec<_> = references.iter().copied().zip(texts.into_iter().map(Value::Text)).collect();
    component.instance.set(&pairs)
}

/// A type that no variable of the FMU has: only a count of 0 is accepted.
pub fn none_of(kind: &str, count: usize) -> Result<(), String> {
    if count == 0 { Ok(()) } else { Err(format!("there are no variables of type {kind}")) }
}

/// A function of another kind of FMU.
pub fn not_here<T>(kind: &str) -> Result<T, String> {
    Err(format!("this FMU is for co-simulation, and the function is of {kind}"))
}

/// Saves the state into a new one, or into the one at `place`.
///
/// # Safety
/// `place` is a place for a pointer: null, or made by this function.
pub unsafe fn save(component: &mut Component, place: *mut *mut c_void) -> Result<(), String> {
    // SAFETY: as promised by the caller.
    let place = unsafe { place.as_mut() }.ok_or("FMUState is null")?;
    let saved = component.instance.save();
    // SAFETY: as promised by the caller.
    match unsafe { place.cast::<Saved>().as_mut() } {
        Some(there) => *there = saved,
        None => *place = Box::into_raw(Box::new(saved)).cast(),
    }
    Ok(())
}

/// The state at a pointer.
///
/// # Safety
/// Null, or a pointer of [`save`], for as long as `'a`.
pub unsafe fn saved<'a>(state: *mut c_void) -> Result<&'a Saved, String> {
    // SAFETY: as promised by the caller.
    unsafe { state.cast::<Saved>().as_ref() }.ok_or_else(|| "FMUState is null".to_string())
}

/// Frees a state, and sets its place to null.
///
/// # Safety
/// `place` is null, or a place for a pointer: null, or made by [`save`].
pub unsafe fn free_saved(place: *mut *mut c_void) {
    // SAFETY: as promised by the caller.
    if let Some(place) = unsafe { place.as_mut() } {
        if !place.is_null() {
            // SAFETY: as promised by the caller.
            drop(unsafe { Box::from_raw(place.cast::<Saved>()) });
        }
        *place = std::ptr::null_mut();
    }
}

/// The size of a state as bytes.
///
/// # Safety
/// `state` as [`saved`], `size` as [`put`].
pub unsafe fn serialized_size(component: &Component, state: *mut c_void, size: *mut usize) -> Result<(), String> {
    // SAFETY: as promised by the caller.
    unsafe { put(size, component.instance.serialize(saved(state)?)?.len()) };
    Ok(())
}

/// A state as bytes, into an array of at least [`serialized_size`].
///
/// # Safety
/// `state` as [`saved`], `bytes` as [`slice`].
pub unsafe fn serialize(component: &Component, state: *mut c_void, bytes: *mut u8, size: usize) -> Result<(), String> {
    // SAFETY: as promised by the caller.
    let (made, places) =
        unsafe { (component.instance.serialize(saved(state)?)?, slice_mut(bytes, size, "the array")?) };
    let short = || format!("the array has {size} bytes, and the state has {}", made.len());
    places.get_mut(..made.len()).ok_or_else(short)?.copy_from_slice(&made);
    Ok(())
}

/// A new state from bytes, after which others may follow.
///
/// # Safety
/// `bytes` as [`slice`], `place` a place for a pointer.
pub unsafe fn deserialize(
    component: &Component,
    bytes: *const u8,
    size: usize,
    place: *mut *mut c_void,
) -> Result<(), String> {
    // SAFETY: as promised by the caller.
    let (bytes, place) = unsafe { (slice(bytes, size, "the array")?, place.as_mut().ok_or("FMUState is null")?) };
    let saved = component.instance.deserialize(bytes)?;
    // SAFETY: as promised by the caller.
    match unsafe { place.cast::<Saved>().as_mut() } {
        Some(there) => *there = saved,
        None => *place = Box::into_raw(Box::new(saved)).cast(),
    }
    Ok(())
}

/// The arrays of a derivative with their lengths.
pub struct Derivative {
    pub unknowns: (*const u32, usize),
    pub knowns: (*const u32, usize),
    pub seed: (*const f64, usize),
    pub sensitivity: (*mut f64, usize),
}

impl Derivative {
    /// ∂unknowns/∂knowns · seed
    ///
    /// # Safety
    /// Every array as [`slice`].
    pub unsafe fn directional(&self, component: &Component) -> Result<(), String> {
        // SAFETY: as promised by the caller.
        let (rows, seed, sensitivity) = unsafe { (self.rows(component)?, self.seed()?, self.sensitivity()?) };
        for (place, row) in sensitivity.iter_mut().zip(&rows) {
            *place = row.iter().zip(seed).map(|(derivative, seed)| derivative * seed).sum();
        }
        Ok(())
    }

    /// seed · ∂unknowns/∂knowns
    ///
    /// # Safety
    /// Every array as [`slice`].
    pub unsafe fn adjoint(&self, component: &Component) -> Result<(), String> {
        // SAFETY: as promised by the caller.
        let (rows, seed, sensitivity) = unsafe { (self.rows(component)?, self.seed()?, self.sensitivity()?) };
        for (column, place) in sensitivity.iter_mut().enumerate() {
            *place = rows.iter().zip(seed).map(|(row, seed)| row[column] * seed).sum();
        }
        Ok(())
    }

    /// A row for each unknown.
    unsafe fn rows(&self, component: &Component) -> Result<Vec<Vec<f64>>, String> {
        let ((unknowns, m), (knowns, n)) = (self.unknowns, self.knowns);
        // SAFETY: as promised by the caller.
        let (unknowns, knowns) = unsafe { (slice(unknowns, m, "unknowns")?, slice(knowns, n, "knowns")?) };
        component.instance.derivatives(unknowns, knowns)
    }

    unsafe fn seed<'a>(&self) -> Result<&'a [f64], String> {
        // SAFETY: as promised by the caller.
        unsafe { slice(self.seed.0, self.seed.1, "the seed") }
    }

    unsafe fn sensitivity<'a>(&self) -> Result<&'a mut [f64], String> {
        // SAFETY: as promised by the caller.
        unsafe { slice_mut(self.sensitivity.0, self.sensitivity.1, "the sensitivity") }
    }
}

/// The functions that save and restore a state, which have the same form in both versions.
macro_rules! saved_states {
    ($status:ty: $get:ident, $set:ident, $free:ident, $size:ident, $serialize:ident, $deserialize:ident) => {
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $get(c: *mut c_void, state: *mut *mut c_void) -> $status {
            unsafe { call(c, stringify!($get), |component| c::save(component, state)) }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $set(c: *mut c_void, state: *mut c_void) -> $status {
            unsafe { call(c, stringify!($set), |component| component.instance.restore(c::saved(state)?)) }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $free(c: *mut c_void, state: *mut *mut c_void) -> $status {
            unsafe {
                call(c, stringify!($free), |_| {
                    c::free_saved(state);
                    Ok(())
                })
            }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $size(c: *mut c_void, state: *mut c_void, size: *mut usize) -> $status {
            unsafe { call(c, stringify!($size), |component| c::serialized_size(component, state, size)) }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $serialize(
            c: *mut c_void,
            state: *mut c_void,
            bytes: *mut u8,
            size: usize,
        ) -> $status {
            unsafe { call(c, stringify!($serialize), |component| c::serialize(component, state, bytes, size)) }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $deserialize(
            c: *mut c_void,
            bytes: *const u8,
            size: usize,
            state: *mut *mut c_void,
        ) -> $status {
            unsafe { call(c, stringify!($deserialize), |component| c::deserialize(component, bytes, size, state)) }
        }
    };
}
pub(crate) use saved_states;
