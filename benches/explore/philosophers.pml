/* Three philosophers take the left fork first: a deadlock. */
bool fork[3] = true;

active [3] proctype philosopher() {
  byte left, right;
  left = _pid;
  right = (_pid + 1) % 3;
  atomic { fork[left]; fork[left] = false };
  atomic { fork[right]; fork[right] = false };
  fork[right] = true;
  fork[left] = true
}
