//! The FMU PmsmDriveMean.

fmu_export::export!(drive::PmsmDriveMean: ContinuousTime + Events + Warns);
