//! The FMU MappedDrive.

fmu_export::export!(drive::MappedDrive: ContinuousTime + Events + Warns);
