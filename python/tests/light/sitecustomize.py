"""On the path of interpreters that tests start: python-can imports asammdf where it is installed, and pandas with it, 3 s of CPU each time."""

import sys

sys.modules["asammdf"] = None  # as in an environment without the extra `mdf`
