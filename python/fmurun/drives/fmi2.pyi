PmsmDrive: str
PmsmDriveMean: str
PmsmPlant: str
SensorlessController: str
