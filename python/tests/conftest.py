"""A test that never ends says where, and ends the run."""

import faulthandler

faulthandler.dump_traceback_later(120, exit=True)
