//! Raw calls of an FMU's binary, for the checker: every function of both standards, with arguments that a well-behaved
//! importer would never pass.
//!
//! No argument that safe code can form makes a call undefined behavior by itself. Instances and saved states are entries of a
//! table that [`Raw`] owns: one that is freed, or of another binary, is refused before the call. Arrays are at least as long as
//! their count, or NULL; pointers to texts come from [`CStr`](std::ffi::CStr) only; a function is named by a type whose values
//! all have one C signature. The calls of a `Raw` follow one another. The checker tests how the FMU reacts to NULL, to unknown
//! value references, to a call in the wrong state; it makes these calls in a separate process.
//!
//! # Panics
//! Every call panics if its instance or its state is freed or of another binary.

mod buffer;
mod callbacks;
mod equations;
mod instantiate;
mod library;
mod names;
mod optional;
mod owned;
mod processor;
mod results;
mod states;
mod updates;

pub use buffer::{Buffer, type_name, width};
pub use callbacks::{LogCall, allocations, take_events};
pub use equations::SensitivityArguments;
pub use instantiate::Arguments;
pub use library::Raw;
pub use names::{Count, Interface, Optional, Sensitivity, Simple, StepStatus, Text, Vector};
pub use owned::{Handle, SavedState};
pub use processor::{armed_timers, float_control, locale};
pub use results::{ResultPointers, StepResults, UpdateResults, flag_text, number_text};
pub use updates::{Answered, Heard, Inside, Meanwhile};
