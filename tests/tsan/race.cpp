// SPDX-License-Identifier: LGPL-2.1-or-later
// A data race on purpose: tests/ci/tsan.sh has to find it. The second thread's lock is another one than the
// first's.
#include <glib.h>

#include <thread>

namespace {

GMutex one, other;
int shared = 0;

void write_with(GMutex* mutex) {
  for (int i = 0; i < 1000; ++i) {
    g_mutex_lock(mutex);
    ++shared;
    g_mutex_unlock(mutex);
  }
}

} // namespace

int main(int argc, char**) {
  GMutex* const second = argc > 1 ? &one : &other; // with an argument there is none
  std::thread thread(write_with, &one);
  write_with(second);
  thread.join();
  return shared == 0;
}
