"""EtherCAT drives (CiA 402) by pysoem: three axes in torque, a gripper in velocity, forces from an analog terminal."""
