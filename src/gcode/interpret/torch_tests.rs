//! What LinuxCNC, QtPlasmaC and other plasma tables make of a text.
