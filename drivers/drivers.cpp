// Anchors the library until its devices are in.
