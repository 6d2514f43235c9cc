//! The FMU SensorlessController.
