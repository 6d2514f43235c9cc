//! The FMU SensorlessController.

fmu_export::export!(drive::SensorlessController: Sampled + Warns);
