// SPDX-License-Identifier: LGPL-2.1-or-later
// Preloaded into a program and those that it starts: a call on their unfinished files fails, or is the last
// thing they do. Counted are write, writev, fsync and rename of files named *.part, of all processes
// together. FAULT is one of:
// - count:FILE   writes the number of calls into FILE at the end
// - before:N     SIGKILL for all instead of the N-th call (N from 1)
// - after:N      SIGKILL for all after the N-th call
// - crash:TEXT   SIGSEGV for the process that writes a file with TEXT in its path
// - crash-once:TEXT   the same, but only the first time
// - kill:TEXT    SIGKILL for it
// - hang:TEXT    a call for such a file never returns
// - stop:N       SIGSTOP for the first process at the N-th call, which is done after SIGCONT
// - wait:N       the N-th call takes 4 seconds
// - 28:N         the N-th call and all later ones fail with that errno (28 = ENOSPC, 5 = EIO) after 0.1 s
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/uio.h>
#include <unistd.h>

/* Shared by the processes. */
static struct {
  atomic_int calls;
  atomic_int crashes;
  pid_t first;
} * all;

__attribute__((constructor)) static void begin(void) {
  const char* known = getenv("FAULT_SHARED");
  const int fd = known ? atoi(known) : memfd_create("faults", 0);
  if (fd < 0 || (!known && ftruncate(fd, sizeof *all) != 0))
    abort();
  all = mmap(NULL, sizeof *all, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (all == MAP_FAILED)
    abort();
  if (known)
    return;
  all->first = getpid();
  char number[16];
  snprintf(number, sizeof number, "%d", fd);
  setenv("FAULT_SHARED", number, 1);
}

/* As a power cut: others end when the first is gone. */
static void kill_all(void) {
  kill(all->first, SIGKILL);
  kill(getpid(), SIGKILL);
}

static char state_of(pid_t process) {
  char name[32], text[512] = "";
  snprintf(name, sizeof name, "/proc/%d/stat", (int)process);
  FILE* file = fopen(name, "r");
  if (!file)
    return 0;
  const size_t length = fread(text, 1, sizeof text - 1, file);
  fclose(file);
  text[length] = '\0';
  const char* end = strrchr(text, ')');
  return end && end[1] ? end[2] : 0;
}

static void stop_first(void) {
  if (getpid() == all->first) {
    raise(SIGSTOP);
    return;
  }
  kill(all->first, SIGSTOP);
  while (state_of(all->first) != 'T' && state_of(all->first) != 0)
    usleep(1000);
  while (state_of(all->first) == 'T')
    usleep(1000);
}

static int ends_with_part(const char* path) {
  const size_t length = strlen(path);
  return length > 5 && strcmp(path + length - 5, ".part") == 0;
}

static int decide(const char* path);

static int decide_fd(int fd) {
  char link[64], path[4096];
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0)
    return 0;
  path[length] = '\0';
  return ends_with_part(path) ? decide(path) : 0;
}

/* 0 = go on; 1 = fail with errno; 2 = die when it is done. */
static int decide(const char* path) {
  const char* fault = getenv("FAULT");
  const int number = atomic_fetch_add(&all->calls, 1) + 1;
  const char* colon = fault ? strchr(fault, ':') : NULL;
  if (!colon || strncmp(fault, "count", 5) == 0)
    return 0;
  if ((strncmp(fault, "crash", 5) == 0 || strncmp(fault, "kill", 4) == 0) && strstr(path, colon + 1)) {
    if (strncmp(fault, "crash-once", 10) != 0 || atomic_fetch_add(&all->crashes, 1) == 0)
      raise(*fault == 'c' ? SIGSEGV : SIGKILL);
    return 0;
  }
  if (strncmp(fault, "hang", 4) == 0) {
    while (strstr(path, colon + 1))
      pause();
    return 0;
  }
  const int wanted = atoi(colon + 1);
  if (strncmp(fault, "before", 6) == 0 && number == wanted)
    kill_all();
  if (strncmp(fault, "stop", 4) == 0 && number == wanted)
    stop_first();
  if (strncmp(fault, "wait", 4) == 0 && number == wanted)
    sleep(4);
  if (strncmp(fault, "after", 5) == 0)
    return number == wanted ? 2 : 0;
  if (atoi(fault) > 0 && number >= wanted) {
    if (number == wanted)
      usleep(100000);
    errno = atoi(fault);
    return 1;
  }
  return 0;
}

static void finish(int decision) {
  if (decision == 2)
    kill_all();
}

#define REAL(name, type) (__extension__(type) dlsym(RTLD_NEXT, name))

ssize_t write(int fd, const void* data, size_t size) {
  const int decision = decide_fd(fd);
  if (decision == 1)
    return -1;
  const ssize_t result = REAL("write", ssize_t(*)(int, const void*, size_t))(fd, data, size);
  finish(decision);
  return result;
}

ssize_t writev(int fd, const struct iovec* parts, int count) {
  const int decision = decide_fd(fd);
  if (decision == 1)
    return -1;
  const ssize_t result = REAL("writev", ssize_t(*)(int, const struct iovec*, int))(fd, parts, count);
  finish(decision);
  return result;
}

int fsync(int fd) {
  const int decision = decide_fd(fd);
  if (decision == 1)
    return -1;
  const int result = REAL("fsync", int (*)(int))(fd);
  finish(decision);
  return result;
}

int rename(const char* from, const char* to) {
  const int decision = ends_with_part(from) ? decide(from) : 0;
  if (decision == 1)
    return -1;
  const int result = REAL("rename", int (*)(const char*, const char*))(from, to);
  finish(decision);
  return result;
}

__attribute__((destructor)) static void report(void) {
  const char* fault = getenv("FAULT");
  if (!fault || strncmp(fault, "count:", 6) != 0)
    return;
  FILE* file = fopen(fault + 6, "w");
  if (file) {
    fprintf(file, "%d\n", atomic_load(&all->calls));
    fclose(file);
  }
}
