"""Driver of moteus controllers (mjbots) behind an fdcanusb adapter: documented register frames, no package needed.

https://github.com/mjbots/moteus/tree/main/docs/protocol (snapshot db1a762) is the source of every number here.
"""
