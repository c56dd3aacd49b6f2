"""Processes that can be killed wherever they are, and the messages exchanged with them.

Neither loky nor pebble serves for this. loky cannot end one worker that takes too long. pebble can,
but it leaves the processes running that the worker has started, cannot be used in a daemonic
process, as the workers of Dask are, and unpickles whatever the worker sends, which is not safe
where it is a student's file that runs there.
"""
