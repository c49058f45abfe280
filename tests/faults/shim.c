// Preloaded into a program: counts its calls that open, read, write and name files and start threads, and has one of
// them fail.
//
//   FAULT_AT=K     the K-th call fails, counted from 1; 0: none does
//   FAULT_HOW      once (default); on: that call and all later ones that write; short: a write or read of half, then it
//   goes on;
//                  cut: a write ends at a boundary of 512 bytes, and the process dies there, as with a power cut;
//                  memory: allocations are counted instead, from the first of these calls on, and the K-th finds none
//   FAULT_LOG      gets a line of the call that failed: its name and file; with FAULT_AT=0 one of each call
//
// stdout and stderr are not counted. What a FILE writes is counted where it reaches the descriptor: fopen() and
// fdopen() give streams on the calls below, but for libstdc++, which opens by fopen64() and then writes by itself.
#define _GNU_SOURCE
#undef _FORTIFY_SOURCE  // its read() and open() would stand before these
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum { kBlock = 512, kOnce = 'o', kOn = 'n', kShort = 's', kCut = 'c', kMemory = 'm' };

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define FAIL(code, value) return errno = (code), (value)

static atomic_long calls, allocations;
extern void* __libc_malloc(size_t);
extern void* __libc_memalign(size_t, size_t);
extern int __libc_start_main(int (*)(int, char**, char**), int, char**, void (*)(void), void (*)(void), void (*)(void),
                             void*);

static int how(void) {
  const char* word = getenv("FAULT_HOW");
  return word == NULL || strcmp(word, "once") == 0 ? kOnce : strcmp(word, "on") == 0 ? kOn : word[0];
}

static void note(const char* call, int descriptor, const char* path) {
  char line[4600], link[64], name[4096] = "";
  if (path == NULL && descriptor >= 0) {
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    const ssize_t n = syscall(SYS_readlink, link, name, sizeof name - 1);
    name[n > 0 ? n : 0] = 0;
  }
  const int length = snprintf(line, sizeof line, "%s %s\n", call, path != NULL ? path : name);
  const int log = (int)syscall(SYS_openat, AT_FDCWD, getenv("FAULT_LOG"), O_WRONLY | O_APPEND | O_CREAT, 0600);
  syscall(SYS_write, log, line, (size_t)length);
  syscall(SYS_close, log);
}

// Memory: operator new and the C library's own come here.
static atomic_int in_main, begun;
static int (*real_main)(int, char**, char**);
static int counted_main(int n, char** words, char** environment) {
  atomic_store(&in_main, getenv("FAULT_HOW") != NULL && how() == kMemory);
  const int code = real_main(n, words, environment);
  atomic_store(&begun, 0);
  if (atomic_exchange(&in_main, 0) != 0 && getenv("FAULT_LOG") != NULL) {
    char line[64];
    snprintf(line, sizeof line, "allocations %ld", atomic_load(&allocations));
    note(line, -1, "");
  }
  return code;
}
int __libc_start_main(int (*main)(int, char**, char**), int n, char** words, void (*init)(void), void (*fini)(void),
                      void (*loader_fini)(void), void* stack) {
  real_main = main;
  return REAL(__libc_start_main)(counted_main, n, words, init, fini, loader_fini, stack);
}
static atomic_long told_at = -1;
static int no_memory(void) {
  if (atomic_load(&begun) == 0) return 0;
  const char* text = getenv("FAULT_AT");
  const long at = atomic_load(&told_at) >= 0 ? atomic_load(&told_at) : text != NULL ? atol(text) : 0;
  return atomic_fetch_add(&allocations, 1) + 1 == at;
}
// For programs that count a part of themselves (python_memory.py): the at-th allocation from now on fails, 0: none
// does; -1: they are not counted any more. Returns how many were.
long fault_memory(long at) {
  atomic_store(&begun, 0);
  const long counted = atomic_exchange(&allocations, 0);
  atomic_store(&told_at, at);
  atomic_store(&begun, at >= 0);
  return counted;
}
void* malloc(size_t n) {
  if (no_memory()) FAIL(ENOMEM, NULL);
  return __libc_malloc(n);
}
void* aligned_alloc(size_t alignment, size_t n) {
  if (no_memory()) FAIL(ENOMEM, NULL);
  return __libc_memalign(alignment, n);
}

// Whether this call is the one that fails.
static int fails(const char* call, int descriptor, const char* path, int writes) {
  if (getenv("FAULT_LOG") == NULL || descriptor == STDOUT_FILENO || descriptor == STDERR_FILENO) return 0;
  if (how() == kMemory) {
    atomic_store(&begun, in_main);
    return 0;
  }
  const char* text = getenv("FAULT_AT");
  const long at = text != NULL ? atol(text) : 0, k = atomic_fetch_add(&calls, 1) + 1;
  const int saved = errno;
  if (at == 0 || k == at) note(call, descriptor, path);
  if (k == at && how() == kCut && strstr(call, "write") == NULL) kill(getpid(), SIGKILL);
  errno = saved;
  return at > 0 && (k == at || (k > at && writes && how() == kOn));
}

static int opened(const char* call, const char* path, int flags, mode_t mode) {
  const int makes = (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE;
  if (fails(call, -1, path, makes)) FAIL(makes ? ENOSPC : EMFILE, -1);
  return (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}
#define OPEN(name)                             \
  int name(const char* path, int flags, ...) { \
    va_list more;                              \
    va_start(more, flags);                     \
    const mode_t mode = va_arg(more, mode_t);  \
    va_end(more);                              \
    return opened(#name, path, flags, mode);   \
  }
OPEN(open)
OPEN(open64)

static ssize_t written(const char* call, int descriptor, const void* from, size_t n, off_t at) {
  if (fails(call, descriptor, NULL, 1)) {
    const int kind = how();
    if (kind != kShort && kind != kCut) FAIL(ENOSPC, -1);
    n = kind == kCut ? n / 2 / kBlock * kBlock : n > 1 ? n / 2 : n;
    const ssize_t done = n == 0   ? 0
                         : at < 0 ? syscall(SYS_write, descriptor, from, n)
                                  : syscall(SYS_pwrite64, descriptor, from, n, at);
    if (kind == kCut) kill(getpid(), SIGKILL);
    return done;
  }
  return at < 0 ? syscall(SYS_write, descriptor, from, n) : syscall(SYS_pwrite64, descriptor, from, n, at);
}
ssize_t write(int d, const void* from, size_t n) { return written("write", d, from, n, -1); }
ssize_t pwrite(int d, const void* from, size_t n, off_t at) { return written("pwrite", d, from, n, at); }
ssize_t pwrite64(int d, const void* from, size_t n, off_t at) { return written("pwrite", d, from, n, at); }
ssize_t writev(int d, const struct iovec* parts, int n) {
  if (fails("writev", d, NULL, 1)) {
    if (how() == kCut) kill(getpid(), SIGKILL);
    if (how() != kShort) FAIL(ENOSPC, -1);
    return syscall(SYS_write, d, parts[0].iov_base, parts[0].iov_len);
  }
  return syscall(SYS_writev, d, parts, n);
}

static ssize_t got(const char* call, int descriptor, void* to, size_t n, off_t at) {
  if (fails(call, descriptor, NULL, 0)) {
    if (how() != kShort) FAIL(EIO, -1);
    n = n > 1 ? n / 2 : n;
  }
  return at < 0 ? syscall(SYS_read, descriptor, to, n) : syscall(SYS_pread64, descriptor, to, n, at);
}
ssize_t read(int d, void* to, size_t n) { return got("read", d, to, n, -1); }
ssize_t pread(int d, void* to, size_t n, off_t at) { return got("pread", d, to, n, at); }
ssize_t pread64(int d, void* to, size_t n, off_t at) { return got("pread", d, to, n, at); }

int close(int d) {
  const int bad = fails("close", d, NULL, 0), result = (int)syscall(SYS_close, d);
  if (bad) FAIL(EIO, -1);
  return result;
}
int fsync(int d) {
  if (fails("fsync", d, NULL, 1)) FAIL(EIO, -1);
  return (int)syscall(SYS_fsync, d);
}
int ftruncate(int d, off_t n) {
  if (fails("ftruncate", d, NULL, 1)) FAIL(EIO, -1);
  return (int)syscall(SYS_ftruncate, d, n);
}
int ftruncate64(int d, off_t n) { return ftruncate(d, n); }
int rename(const char* from, const char* to) {
  if (fails("rename", -1, to, 1)) FAIL(ENOSPC, -1);
  return REAL(rename)(from, to);
}
int mkdir(const char* path, mode_t mode) {
  if (fails("mkdir", -1, path, 1)) FAIL(ENOSPC, -1);
  return REAL(mkdir)(path, mode);
}
void* mmap(void* at, size_t n, int protection, int flags, int d, off_t offset) {
  if (d >= 0 && fails("mmap", d, NULL, 0)) FAIL(ENOMEM, MAP_FAILED);
  return (void*)syscall(SYS_mmap, at, n, protection, flags, d, offset);
}
void* mmap64(void* at, size_t n, int protection, int flags, int d, off_t offset) {
  return mmap(at, n, protection, flags, d, offset);
}
int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*start)(void*), void* argument) {
  if (fails("pthread_create", -1, "", 0)) return EAGAIN;
  return REAL(pthread_create)(thread, attributes, start, argument);
}

// Streams.
static ssize_t stream_read(void* d, char* to, size_t n) { return got("read", (int)(intptr_t)d, to, n, -1); }
static ssize_t stream_write(void* d, const char* from, size_t n) {
  for (size_t done = 0; done < n;) {
    const ssize_t part = written("write", (int)(intptr_t)d, from + done, n - done, -1);
    if (part < 0) return done > 0 ? (ssize_t)done : 0;
    done += (size_t)part;
  }
  return (ssize_t)n;
}
static int stream_seek(void* d, off64_t* at, int from) {
  const off64_t there = syscall(SYS_lseek, (int)(intptr_t)d, *at, from);
  if (there < 0) return -1;
  *at = there;
  return 0;
}
static int stream_close(void* d) { return close((int)(intptr_t)d); }

// The library asks for the descriptor of a stream, which those made by fopencookie() have not.
static struct {
  FILE* stream;
  int descriptor;
} streams[256];
FILE* fdopen(int descriptor, const char* mode) {
  const cookie_io_functions_t functions = {stream_read, stream_write, stream_seek, stream_close};
  FILE* stream = fopencookie((void*)(intptr_t)descriptor, mode, functions);
  streams[descriptor & 255].stream = stream;
  streams[descriptor & 255].descriptor = descriptor;
  return stream;
}
int fileno(FILE* stream) {
  for (int k = 0; k < 256; ++k)
    if (streams[k].stream == stream) return streams[k].descriptor;
  return REAL(fileno)(stream);
}
static int flags_of(const char* mode) {
  const int more = strchr(mode, '+') != NULL ? O_RDWR : mode[0] == 'r' ? O_RDONLY : O_WRONLY;
  return more | O_CLOEXEC | (mode[0] == 'r' ? 0 : mode[0] == 'w' ? O_CREAT | O_TRUNC : O_CREAT | O_APPEND);
}
FILE* fopen(const char* path, const char* mode) {
  const int descriptor = opened("fopen", path, flags_of(mode), 0666);
  return descriptor < 0 ? NULL : fdopen(descriptor, mode);
}
FILE* fopen64(const char* path, const char* mode) {
  if (fails("fopen", -1, path, mode[0] != 'r')) FAIL(mode[0] == 'r' ? EMFILE : ENOSPC, NULL);
  return REAL(fopen64)(path, mode);
}
