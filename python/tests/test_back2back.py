"""python-can's own back-to-back tests, from its source distribution, on the embedded bus: unchanged but for what is CAN FD.

That the bus carries classic frames only is asserted in the place of their two tests of CAN FD.
"""

import unittest

import can
import pytest
from test import back2back_test

# Their switch; a bus with CAN FD is refused here.
back2back_test.TEST_CAN_FD = False


class OnEmbeddedBus:
    """Puts both buses of a case on the embedded one."""

    INTERFACE_1 = INTERFACE_2 = "airbench"
    TIMEOUT = 10.0  # theirs is 0.1 s, which a busy machine exceeds; what arrives is not waited for

    @pytest.fixture(autouse=True)
    def channel(self, bus_path):
        """Before their setUp."""
        type(self).CHANNEL_1 = type(self).CHANNEL_2 = bus_path

    @unittest.skipIf(back2back_test.IS_CI, "measures the machine: by 50 ms it may be late")
    def test_send_periodic_duration(self):
        self.TIMEOUT = 0.1
        super().test_send_periodic_duration()

    def test_fd_message(self):
        with self.assertRaisesRegex(can.CanOperationError, "no CAN FD"):
            super().test_fd_message()

    def test_fd_message_with_brs(self):
        with self.assertRaisesRegex(can.CanOperationError, "no CAN FD"):
            super().test_fd_message_with_brs()


class TestBack2Back(OnEmbeddedBus, back2back_test.Back2BackTestCase):
    """Two buses at each other."""


class TestThreadSafe(OnEmbeddedBus, back2back_test.TestThreadSafeBus):
    """The same with a hundred threads at each."""
