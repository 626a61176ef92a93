// SPDX-License-Identifier: LGPL-2.1-or-later
/* Preloaded into a program: the n-th call that matters to its unfinished files fails, or is the last thing it
 * does. Counted are write, writev, fsync and rename of files named *.part. FAULT=count:FILE   how many there
 * were, as text, into FILE at the end FAULT=before:N     SIGKILL instead of the N-th call (N from 1)
 *   FAULT=after:N      SIGKILL when the N-th call has been done
 *   FAULT=stop:N       SIGSTOP at the N-th call; after SIGCONT it is done as if nothing had been
 *   FAULT=wait:N       the N-th call takes 4 seconds
 *   FAULT=28:N         the N-th call fails with that errno (28 = ENOSPC, 5 = EIO), and so does every one
 * after it; as disks do, it takes its time to: whoever does not wait for the call does not hear of it */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_int calls;

static int ends_with_part(const char* path) {
  const size_t length = strlen(path);
  return length > 5 && strcmp(path + length - 5, ".part") == 0;
}

static int is_part(int fd) {
  char link[64], path[4096];
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0)
    return 0;
  path[length] = '\0';
  return ends_with_part(path);
}

/* 0 = go on; 1 = fail with errno; 2 = die when it is done. */
static int decide(void) {
  const char* fault = getenv("FAULT");
  const int number = atomic_fetch_add(&calls, 1) + 1;
  const char* colon = fault ? strchr(fault, ':') : NULL;
  if (!colon || strncmp(fault, "count", 5) == 0)
    return 0;
  const int wanted = atoi(colon + 1);
  if (strncmp(fault, "before", 6) == 0 && number == wanted)
    kill(getpid(), SIGKILL);
  if (strncmp(fault, "stop", 4) == 0 && number == wanted)
    raise(SIGSTOP);
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
    kill(getpid(), SIGKILL);
}

#define REAL(name, type) (__extension__(type) dlsym(RTLD_NEXT, name))

ssize_t write(int fd, const void* data, size_t size) {
  const int decision = is_part(fd) ? decide() : 0;
  if (decision == 1)
    return -1;
  const ssize_t result = REAL("write", ssize_t(*)(int, const void*, size_t))(fd, data, size);
  finish(decision);
  return result;
}

ssize_t writev(int fd, const struct iovec* parts, int count) {
  const int decision = is_part(fd) ? decide() : 0;
  if (decision == 1)
    return -1;
  const ssize_t result = REAL("writev", ssize_t(*)(int, const struct iovec*, int))(fd, parts, count);
  finish(decision);
  return result;
}

int fsync(int fd) {
  const int decision = is_part(fd) ? decide() : 0;
  if (decision == 1)
    return -1;
  const int result = REAL("fsync", int (*)(int))(fd);
  finish(decision);
  return result;
}

int rename(const char* from, const char* to) {
  const int decision = ends_with_part(from) ? decide() : 0;
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
    fprintf(file, "%d\n", atomic_load(&calls));
    fclose(file);
  }
}
