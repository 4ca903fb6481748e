"""Streams a job with grbl-streamer: PORT JOB. Ends with 0 if that program says that the job is done.

grbl-streamer 2.0.2 sends from two threads without a lock: the one that calls job_run(), and the one that reads answers.
A job begun from another thread now and then loses one of its first lines, before it reaches the port. So the job is begun
from a callback, which runs in the reading thread: then there is only one.
"""

import sys
import threading
import time

from grbl_streamer import GrblStreamer

port, job = sys.argv[1:]
booted, start, completed = threading.Event(), threading.Event(), threading.Event()
troubles = []


def told(event, *data):
    if event == "on_boot":
        booted.set()
    elif event == "on_rx_buffer_percent" and start.is_set():
        # An answer has been dealt with.
        start.clear()
        streamer.job_run()
    elif event == "on_job_completed":
        completed.set()
    elif event in ("on_error", "on_alarm"):
        troubles.append((event, data))
        completed.set()


streamer = GrblStreamer(told)
streamer.cnect(port, 115200)
if not booted.wait(10):
    print("no banner", file=sys.stderr)
    sys.exit(2)
streamer.poll_start()
# What it asks by itself after the banner must be answered first, or it takes those answers for the job's.
time.sleep(2)
streamer.job_new()
streamer.load_file(job)
completed.clear()
start.set()
streamer.gcode_parser_state_requested = True
completed.wait(120)
give_up = time.monotonic() + 60
time.sleep(1)
while streamer.cmode != "Idle" and not troubles and time.monotonic() < give_up:
    time.sleep(0.1)
idle = streamer.cmode == "Idle"
streamer.disconnect()
print(troubles, file=sys.stderr)
sys.exit(0 if idle and not troubles else 1)
