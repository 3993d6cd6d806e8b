/* Two processes increment a counter by a read and a write: one update can be lost. */
byte count = 0;
byte ended = 0;

active [2] proctype increment() {
  byte read;
  read = count;
  count = read + 1;
  ended++
}

active proctype check() {
  ended == 2;
  assert(count == 2)
}
