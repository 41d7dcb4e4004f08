"""EtherCAT slaves emulated at the level of frames: what stands behind a cable when no drives do.

A *segment* is a chain of slaves. Each is a slave controller (registers, memory, mailbox, states, watchdog, clock) and
an application behind it: a CiA 402 drive, an analog terminal, a bus coupler. Written after the register description of
Beckhoff's ET1100 and the ETG.1000 series, as far as a master of the SOEM family uses them.
"""
