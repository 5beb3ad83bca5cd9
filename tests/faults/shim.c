/* Test-only: a library to preload that lets a program's file calls fail, tear or end it, and its clocks jump.
 *
 * Calls that change files under FAULT_DIR are numbered from 1: open to write, write, truncate, fsync, rename, remove,
 * mkdir. Before the call with number FAULT_AT
 *   FAULT_SIGNAL=n  this signal is raised (9: a kill between two system calls); with FAULT_TORN=1 a write does its
 *                   first half before;
 *   FAULT_ERRNO=n   the call fails with this errno, and so do all after it (FAULT_ONCE=1: none after it). A write does
 *                   its first half, as on a disk that becomes full. With ENOSPC removing still works.
 * FAULT_LOG=path appends a line "number call path" for each of them.
 * FAULT_CLOCK=seed lets every clock jump by up to an hour, back or forth, at each reading.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;
static long calls;

static long number_in(const char* name) {
  const char* text = getenv(name);
  return text ? atol(text) : 0;
}

static int is_under_test(const char* path) {
  const char* directory = getenv("FAULT_DIR");
  return directory && strncmp(path, directory, strlen(directory)) == 0;
}

static void note(long number, const char* call, const char* path) {
  const char* log = getenv("FAULT_LOG");
  if (!log) return;
  char line[PATH_MAX + 64];
  const int length = snprintf(line, sizeof line, "%ld %s %s\n", number, call, path);
  const int descriptor = REAL(open)(log, O_WRONLY | O_CREAT | O_APPEND, 0644);
  if (descriptor >= 0 && REAL(write)(descriptor, line, (size_t)length) < 0) abort();
  close(descriptor);
}

enum Verdict { go_on, fail, tear };

/* What becomes of a call on this path; does not return where it is the end. */
static enum Verdict verdict(const char* call, const char* path, int is_write, int removes) {
  if (!is_under_test(path)) return go_on;
  pthread_mutex_lock(&guard);
  const long number = ++calls;
  pthread_mutex_unlock(&guard);
  note(number, call, path);
  const long at = number_in("FAULT_AT");
  if (at == 0 || number < at) return go_on;
  const int sign = (int)number_in("FAULT_SIGNAL"), trouble = (int)number_in("FAULT_ERRNO");
  if (sign != 0 && number == at) {
    if (is_write && number_in("FAULT_TORN")) return tear;
    raise(sign);
  }
  if (trouble == 0 || (number > at && number_in("FAULT_ONCE")) || (removes && trouble == ENOSPC)) return go_on;
  if (is_write && number == at && !number_in("FAULT_ONCE")) return tear;
  errno = trouble;
  return fail;
}

static const char* path_of(int descriptor, char path[PATH_MAX]) {
  char link[64];
  snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  const ssize_t length = readlink(link, path, PATH_MAX - 1);
  path[length > 0 ? length : 0] = '\0';
  return path;
}

/* After the first half of a write. */
static void finish_torn(void) {
  const int sign = (int)number_in("FAULT_SIGNAL");
  if (sign != 0) raise(sign);
}

#define FD_CALL(call, descriptor, is_write)                                                            \
  char path[PATH_MAX];                                                                                 \
  const int before = errno;                                                                            \
  const enum Verdict said = verdict(call, path_of(descriptor, path), is_write, 0);                     \
  if (said == fail) return -1;                                                                         \
  errno = before

ssize_t write(int descriptor, const void* data, size_t bytes) {
  FD_CALL("write", descriptor, 1);
  if (said != tear) return REAL(write)(descriptor, data, bytes);
  const ssize_t done = REAL(write)(descriptor, data, bytes / 2);
  finish_torn();
  return done;
}

static ssize_t pwrite_any(int descriptor, const void* data, size_t bytes, off_t at) {
  FD_CALL("pwrite", descriptor, 1);
  if (said != tear) return REAL(pwrite)(descriptor, data, bytes, at);
  const ssize_t done = REAL(pwrite)(descriptor, data, bytes / 2, at);
  finish_torn();
  if (done == 0) errno = (int)number_in("FAULT_ERRNO");
  return done > 0 ? done : -1;
}
ssize_t pwrite(int descriptor, const void* data, size_t bytes, off_t at) { return pwrite_any(descriptor, data, bytes, at); }
ssize_t pwrite64(int descriptor, const void* data, size_t bytes, off64_t at) { return pwrite_any(descriptor, data, bytes, at); }

ssize_t writev(int descriptor, const struct iovec* parts, int count) {
  FD_CALL("writev", descriptor, 0);
  return REAL(writev)(descriptor, parts, count);
}

static int ftruncate_any(int descriptor, off_t length) {
  FD_CALL("ftruncate", descriptor, 0);
  return REAL(ftruncate)(descriptor, length);
}
int ftruncate(int descriptor, off_t length) { return ftruncate_any(descriptor, length); }
int ftruncate64(int descriptor, off64_t length) { return ftruncate_any(descriptor, length); }

int fsync(int descriptor) {
  FD_CALL("fsync", descriptor, 0);
  return REAL(fsync)(descriptor);
}

#define OPENS(name)                                                                                    \
  int name(const char* path, int flags, ...) {                                                         \
    va_list more;                                                                                      \
    va_start(more, flags);                                                                             \
    const mode_t mode = (flags & O_CREAT) ? va_arg(more, mode_t) : 0;                                  \
    va_end(more);                                                                                      \
    if ((flags & O_ACCMODE) != O_RDONLY && verdict("open", path, 0, 0) == fail) return -1;             \
    return REAL(name)(path, flags, mode);                                                              \
  }
OPENS(open)
OPENS(open64)

#define FOPENS(name)                                                                                   \
  FILE* name(const char* path, const char* mode) {                                                     \
    if (strpbrk(mode, "wa+") && verdict("open", path, 0, 0) == fail) return NULL;                      \
    return REAL(name)(path, mode);                                                                     \
  }
FOPENS(fopen)
FOPENS(fopen64)

int rename(const char* from, const char* to) {
  return verdict("rename", to, 0, 0) == fail ? -1 : REAL(rename)(from, to);
}
int unlink(const char* path) { return verdict("remove", path, 0, 1) == fail ? -1 : REAL(unlink)(path); }
int remove(const char* path) { return verdict("remove", path, 0, 1) == fail ? -1 : REAL(remove)(path); }
int mkdir(const char* path, mode_t mode) { return verdict("mkdir", path, 0, 0) == fail ? -1 : REAL(mkdir)(path, mode); }

int clock_gettime(clockid_t clock, struct timespec* now) {
  static _Atomic uint64_t state;
  const int result = REAL(clock_gettime)(clock, now);
  const long seed = number_in("FAULT_CLOCK");
  if (result != 0 || seed == 0) return result;
  const uint64_t x = (state += 0x9e3779b97f4a7c15u + (uint64_t)seed) * 0xbf58476d1ce4e5b9u;
  now->tv_sec += (time_t)((x >> 33) % 7200) - 3600;
  return result;
}
