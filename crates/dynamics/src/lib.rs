//! Plant models of the bike robot, its actuators and sensors.
