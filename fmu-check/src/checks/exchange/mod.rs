//! Model Exchange: states, derivatives, events.

pub(crate) mod events;
pub(crate) mod model_exchange;
pub(crate) mod sensitivity;
pub(crate) mod shared;
