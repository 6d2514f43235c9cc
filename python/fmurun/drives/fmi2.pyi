MappedDrive: str
PmsmDrive: str
PmsmDriveMean: str
PmsmPlant: str
SensorlessController: str
