"""The one exception of this package."""


class FmuError(Exception):
    """An error of an FMU's file, of its use or of a call; the message is one line.

    It can be pickled, so that it comes back from worker processes whole.

    Attributes:
        function: the C function that returned the status, e.g. ``"fmi3DoStep"``; None for a file or a wrong use
        status: its status, ``"Discard"``, ``"Error"`` or ``"Fatal"``; None for a file or a wrong use
        instance: name of the instance, or what the message is about; None for a file
        message: what the FMU logged, or the cause

    >>> print(FmuError("fmi2SetReal", "Error", "plant", "motor.R_s = -1 is out of range"))
    plant: fmi2SetReal returned Error: motor.R_s = -1 is out of range
    >>> import pickle
    >>> pickle.loads(pickle.dumps(FmuError(None, None, "plant", "was freed"))).message
    'was freed'
    """

    def __init__(self, function, status, instance, message):
        super().__init__(function, status, instance, message)
        self.function, self.status, self.instance, self.message = function, status, instance, message

    def __str__(self):
        call = f"{self.function} returned {self.status}" if self.function else None
        return ": ".join(part for part in (self.instance, call, self.message) if part)
