//! The FMU PmsmDrive.

fmu_export::export!(drive::PmsmDrive);
