"""The list of cases; the modules of `cases` fill it."""

CASES = {}


def case(function=None, *, witness=True):
    """Registers a case: a function of the loaded `Fmu`, named after what it does.

    While it runs, an untouched `witness` instance waits in the same process; its trajectory must not change.
    """
    if function is None:
        return lambda f: case(f, witness=witness)
    assert function.__name__ not in CASES, f"two cases are named {function.__name__}"
    function.witness = witness
    CASES[function.__name__] = function
    return function
