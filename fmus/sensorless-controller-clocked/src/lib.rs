//! The FMU SensorlessControllerClocked.

fmu_export::export!(drive::SensorlessControllerClocked: Clocked + ScheduledExecution + Warns);
