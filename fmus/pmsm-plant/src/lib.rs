//! The FMU PmsmPlant.
