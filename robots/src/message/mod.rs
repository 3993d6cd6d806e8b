//! Messages of ROS 2 whose types are known at run time only: definitions, types with their hashes, and CDR.
//!
//! To a program, a message is a property list of all its fields, in the order of the definition and with
//! keywords for names: `(:HEADER (:STAMP (:SEC 1 :NANOSEC 0) :FRAME-ID "laser") :RANGES #(1.0 2.5) …)`. So it
//! is printed, compared, destructured, asserted and recorded as any list. Arrays of numbers are packed
//! vectors.
//!
//! Guarantees: no text of a definition, no message of a program and no payload makes this module panic;
//! payloads and hashes equal those of other implementations of ROS 2.
//! Not here: the transport (`ros`).

mod bundle;
mod complete;
mod definition;
mod describe;
mod fault;
mod joined;
mod message_type;
#[doc(hidden)]
pub mod noise;
mod reader;
mod scalar;
#[cfg(test)]
mod tests;
mod types;
mod writer;

pub use complete::complete;
pub(crate) use complete::nearest;
pub use definition::{FieldExtent, MessageConstant};
pub use fault::{DefinitionProblem, MessageFault, MessageProblem, TypeFault};
pub use message_type::{ActionType, Element, MessageField, MessageType, ServiceType, keyword};
pub use reader::decode;
pub use scalar::Scalar;
pub use types::Types;
pub use writer::encode;
