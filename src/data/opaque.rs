//! Values of Rust that programs hold.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use esl_bytecode::datum::OpaqueDatum;

use super::{Data, FromData};
use crate::engine::Failure;

/// A type of Rust whose values programs can hold, as [`Opaque`].
pub trait HostType: Send + 'static {
    /// Name of the type, for printing and for failures.
    const NAME: &'static str;

    /// Returns what tells this value from others of its type when the program prints it; asked once.
    fn label(&self) -> String {
        String::new()
    }
}

/// A value of Rust that a program holds, hands on and compares by identity, without looking into it.
///
/// To the program it is a `host-object`, printed as `#<NAME label>`. It is dropped when the program cannot
/// reach it any more and Rust has no clone of it, when [`Opaque::close`] takes it, or with the engine.
///
/// ```
/// use esl::Engine;
/// use esl::data::{HostType, Opaque};
///
/// struct Camera { port: i64, pictures: i64 }
///
/// impl HostType for Camera {
///     const NAME: &'static str = "CAMERA";
///
///     fn label(&self) -> String {
///         format!("at {}", self.port)
///     }
/// }
///
/// let mut engine = Engine::new()?;
/// engine.define("OPEN-CAMERA", "(port)", "A camera.", |call| {
///     Ok(Opaque::new(Camera { port: call.get("port")?, pictures: 0 }))
/// })?;
/// engine.define("PICTURE", "(camera)", "Takes a picture; its number.", |call| {
///     call.get::<Opaque<Camera>>("camera")?.with(|camera| {
///         camera.pictures += 1;
///         camera.pictures
///     })
/// })?;
/// let text = "(let ((c (open-camera 7))) (list (picture c) (picture c) (prin1-to-string c)))";
/// assert_eq!(engine.eval(text)?.to_string(), "(1 2 \"#<CAMERA at 7>\")");
/// # Ok::<(), esl::Error>(())
/// ```
pub struct Opaque<T> {
    shared: Arc<Mutex<Option<T>>>,
    datum: OpaqueDatum,
}

impl<T: HostType> Opaque<T> {
    /// Creates a value for programs.
    pub fn new(value: T) -> Opaque<T> {
        let label = value.label();
        let shared = Arc::new(Mutex::new(Some(value)));
        let datum = OpaqueDatum::new(T::NAME, &label, shared.clone());
        Opaque { shared, datum }
    }

    /// Calls a function with the value, of which no other call has use meanwhile.
    ///
    /// # Errors
    /// A failure `:HOST-OBJECT-CLOSED`, with the value, if it has been closed.
    pub fn with<R>(&self, function: impl FnOnce(&mut T) -> R) -> Result<R, Failure> {
        // A panic of the embedder's may leave a value half-changed, which is for the embedder to know.
        let mut value = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        match &mut *value {
            Some(value) => Ok(function(value)),
            None => Err(Failure::new("HOST-OBJECT-CLOSED", [Data::Opaque(self.datum.clone())])),
        }
    }

    /// Takes the value away from the program, whose further uses of it fail. `None` if it is closed already.
    pub fn close(&self) -> Option<T> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl<T> Clone for Opaque<T> {
    fn clone(&self) -> Opaque<T> {
        Opaque { shared: self.shared.clone(), datum: self.datum.clone() }
    }
}

impl<T> fmt::Debug for Opaque<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.datum.fmt(f)
    }
}

impl<T> From<Opaque<T>> for Data {
    fn from(opaque: Opaque<T>) -> Data {
        Data::Opaque(opaque.datum)
    }
}

impl<T: HostType> FromData for Opaque<T> {
    const TYPE: &'static str = T::NAME;

    fn from_data(data: &Data) -> Option<Opaque<T>> {
        let Data::Opaque(datum) = data else { return None };
        let shared = datum.value().clone().downcast().ok()?;
        Some(Opaque { shared, datum: datum.clone() })
    }
}
