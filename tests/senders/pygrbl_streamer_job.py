"""Streams a job with pygrbl-streamer: PORT JOB. Ends with 0 if that program says that the job is done."""

import sys

from pygrbl_streamer import GrblStreamer

port, job = sys.argv[1:]
streamer = GrblStreamer(port)
streamer.error_callback = lambda line: print("error:", line, file=sys.stderr)
streamer.alarm_callback = lambda line: print("alarm:", line, file=sys.stderr)
streamer.connect()
done = streamer.send_file(job, stop_on_error=True, completion_timeout=120)
streamer.disconnect()
sys.exit(0 if done else 1)
