/* Two readers and a writer share a counter of readers and a flag of the writer: never a reader beside the writer. */
byte readers = 0;
bool writing = false;
byte value = 0;

active [2] proctype reader() {
  byte read;
  atomic { !writing; readers++ };
  read = value;
  readers--
}

active proctype writer() {
  atomic { !writing && readers == 0; writing = true };
  value = 1;
  writing = false
}

active proctype monitor() {
  assert(!(writing && readers > 0))
}
