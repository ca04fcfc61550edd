// SPDX-License-Identifier: BSD-3-Clause
//
// A library for LD_PRELOAD that makes one call of a program fail, or that one and all after it, or cuts its power.
// Linux and glibc.
//
//   CAIRN_FAULT=KIND:N[+][:HOW]   the N-th call of this kind from the start of main fails; with '+' all later ones too
//   CAIRN_FAULT=power:N[:some]    before the N-th change of a file, or at the end, the process is killed, and what was
//                                 written and not synced is lost: all of it, or some sectors of 512 bytes
//   CAIRN_FAULT_LOG=FILE          receives "fired" where the fault happened, and the number of calls of each kind
//   CAIRN_FAULT_TRACE=1           prints to stderr where the call came from
//
// KIND is one of the names in kKinds. HOW is the name of an error, such as EIO, or "short": reads and writes then
// handle half of the bytes, which is no failure. Without HOW each kind fails as it usually does. Calls on standard
// input, output and error are left alone, and so is what libraries do before main.
//
// Nothing here allocates or calls what it replaces: it runs inside malloc.

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>

#include <dlfcn.h>
#include <execinfo.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

// The allocator behind ours: that of glibc or, where a sanitizer frees the memory, of the sanitizer.
extern "C" {
#ifdef CAIRN_FAULTS_UNDER_ADDRESS_SANITIZER
#define CAIRN_BEHIND(name) __interceptor_##name
#else
#define CAIRN_BEHIND(name) __libc_##name
#endif
void* CAIRN_BEHIND(malloc)(std::size_t);
void* CAIRN_BEHIND(calloc)(std::size_t, std::size_t);
void* CAIRN_BEHIND(realloc)(void*, std::size_t);
void* CAIRN_BEHIND(memalign)(std::size_t, std::size_t);
}

namespace {

enum Kind {
  kAllocate,
  kRead,
  kWrite,
  kOpen,
  kClose,
  kSync,
  kRename,
  kUnlink,
  kMakeFolder,
  kTruncate,
  kLock,
  kMap,
  kThread,
  kPower,  // changes of files
  kKinds
};

struct KindOf {
  const char* name;
  int error;
};

constexpr KindOf kNames[kKinds] = {{"allocate", ENOMEM}, {"read", EIO},    {"write", ENOSPC},
                                   {"open", EMFILE},     {"close", EIO},   {"sync", EIO},
                                   {"rename", EIO},      {"unlink", EIO},  {"mkdir", ENOSPC},
                                   {"truncate", EIO},    {"lock", ENOLCK}, {"mmap", ENOMEM},
                                   {"thread", EAGAIN},   {"power", 0}};

struct ErrorOf {
  const char* name;
  int error;
};

constexpr ErrorOf kErrors[] = {{"EIO", EIO},       {"ENOSPC", ENOSPC}, {"EINTR", EINTR},
                               {"EACCES", EACCES}, {"EMFILE", EMFILE}, {"EAGAIN", EAGAIN},
                               {"ENOMEM", ENOMEM}, {"ENOENT", ENOENT}, {"ENOLCK", ENOLCK}};

std::atomic<std::uint64_t> calls[kKinds];
std::atomic<bool> started{false};
std::atomic<bool> fired{false};
int failing = -1;  // a Kind
std::uint64_t first = 0;
bool from_then_on = false;
bool shortened = false;
bool keeps_some = false;  // of what is not synced when the power is cut
int error_number = 0;
bool traces = false;
int log_descriptor = -1;

// Of tracing, which calls what is replaced. Its place is fixed from the start: other thread-local variables of libraries
// are allocated at the first access, by malloc.
[[gnu::tls_model("initial-exec")]] thread_local bool inside = false;

void write_log(const char* text, std::size_t size) {
  if (log_descriptor >= 0) ::syscall(SYS_write, log_descriptor, text, size);
}

void trace() {
  void* frames[64];
  inside = true;
  const int count = ::backtrace(frames, 64);
  ::backtrace_symbols_fd(frames, count, STDERR_FILENO);
  inside = false;
}

// Counts a call; whether it is to fail, with errno set.
bool fails(Kind kind) {
  if (!started.load(std::memory_order_relaxed) || inside) return false;
  const std::uint64_t n = calls[kind].fetch_add(1, std::memory_order_relaxed) + 1;
  if (kind != failing || n < first || (n > first && !from_then_on)) return false;
  if (!fired.exchange(true)) {
    write_log("fired\n", 6);
    if (traces) trace();
  }
  errno = error_number;
  return true;
}

// Reads and writes: the number of bytes to handle, or -1 for a failure.
ssize_t bytes_of(Kind kind, int descriptor, std::size_t size) {
  if (descriptor <= STDERR_FILENO || !fails(kind)) return static_cast<ssize_t>(size);
  if (!shortened) return -1;
  return static_cast<ssize_t>(size > 1 ? size / 2 : size);
}

// A change of a file that is not synced.
struct Change {
  dev_t device;
  ino_t file;
  int descriptor;  // our own, for reading and writing
  off_t offset;
  off_t old_size;  // of the file
  std::size_t size;
  std::size_t old_bytes;  // of them that there were
  unsigned char* bytes;   // old ones, then new ones; null: the file was cut at the offset
  Change* before;
};

constexpr std::size_t kSector = 512;

pthread_mutex_t changes_mutex = PTHREAD_MUTEX_INITIALIZER;
Change* last_change = nullptr;

void write_at(int descriptor, const unsigned char* bytes, std::size_t size, off_t offset) {
  ::syscall(SYS_pwrite64, descriptor, bytes, size, offset);
}

void cut_to(int descriptor, off_t size) {
  ::syscall(SYS_ftruncate, descriptor, size);
}

bool survives(std::uint64_t number, std::uint64_t sector) {
  std::uint64_t mixed = (first * 0x9e3779b97f4a7c15U) ^ (number * 0xbf58476d1ce4e5b9U) ^
                        (sector * 0x94d049bb133111ebU);
  mixed = (mixed ^ (mixed >> 31U)) * 0xd6e8feb86659fd93U;
  return (mixed >> 40U & 1U) != 0;
}

// Loses what is not synced, and ends the process as the loss of power does.
[[noreturn]] void cut_power() {
  Change* oldest = nullptr;
  for (Change* change = last_change; change != nullptr;) {
    if (change->bytes != nullptr)
      write_at(change->descriptor, change->bytes, change->old_bytes, change->offset);
    cut_to(change->descriptor, change->old_size);
    if (change->bytes == nullptr) {  // what was cut off lies behind it
      const auto* const cut = reinterpret_cast<const unsigned char*>(change + 1);
      write_at(change->descriptor, cut, change->old_bytes, change->offset);
    }
    Change* const before = change->before;
    change->before = oldest;  // from here on in the order of time
    oldest = change;
    change = before;
  }
  std::uint64_t number = 0;
  for (const Change* change = oldest; keeps_some && change != nullptr;
       change = change->before, ++number) {
    if (change->bytes == nullptr) {
      if (survives(number, 0)) cut_to(change->descriptor, change->offset);
      continue;
    }
    for (std::size_t at = 0; at < change->size; at += kSector) {
      if (!survives(number, at)) continue;
      const std::size_t size = change->size - at < kSector ? change->size - at : kSector;
      write_at(change->descriptor, change->bytes + change->old_bytes + at, size,
               change->offset + static_cast<off_t>(at));
    }
  }
  write_log("fired\n", 6);
  ::syscall(SYS_kill, ::getpid(), SIGKILL);
  for (;;) ::syscall(SYS_pause);
}

// Counts a change that is about to happen; cuts the power before it if that is asked for.
void before_change() {
  if (!started.load(std::memory_order_relaxed)) return;
  const std::uint64_t n = calls[kPower].fetch_add(1, std::memory_order_relaxed) + 1;
  if (failing != kPower || n != first) return;
  ::pthread_mutex_lock(&changes_mutex);
  cut_power();
}

bool is_watched(int descriptor, struct stat& status) {
  if (failing != kPower || !started.load(std::memory_order_relaxed) || descriptor <= STDERR_FILENO)
    return false;
  return ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
}

// Our own descriptor of a file. It is never closed: closing any would give up the file's locks.
int own_descriptor(int descriptor, const struct stat& status) {
  for (const Change* change = last_change; change != nullptr; change = change->before) {
    if (change->device == status.st_dev && change->file == status.st_ino) return change->descriptor;
  }
  char name[64];
  std::snprintf(name, sizeof name, "/proc/self/fd/%d", descriptor);
  return static_cast<int>(::syscall(SYS_openat, AT_FDCWD, name, O_RDWR | O_CLOEXEC));
}

// Keeps what a write, or a cut where `bytes` is null, is going to replace.
void keep(int descriptor, const void* bytes, std::size_t size, off_t offset) {
  struct stat status = {};
  if (!is_watched(descriptor, status)) return;
  ::pthread_mutex_lock(&changes_mutex);
  const std::size_t known =
      status.st_size > offset ? static_cast<std::size_t>(status.st_size - offset) : 0;
  const std::size_t old_bytes = bytes == nullptr || known < size ? known : size;
  auto* const memory =
      static_cast<unsigned char*>(CAIRN_BEHIND(malloc)(sizeof(Change) + old_bytes + size));
  auto* const change = reinterpret_cast<Change*>(memory);
  unsigned char* const old = memory + sizeof(Change);
  *change = {
      status.st_dev, status.st_ino, own_descriptor(descriptor, status), offset,     status.st_size,
      size,          old_bytes,     bytes != nullptr ? old : nullptr,   last_change};
  ::syscall(SYS_pread64, change->descriptor, old, old_bytes, offset);
  if (bytes != nullptr) std::memcpy(old + old_bytes, bytes, size);
  last_change = change;
  ::pthread_mutex_unlock(&changes_mutex);
}

// What was written to a file, or to all, is safe.
void forget(int descriptor, bool all) {
  struct stat status = {};
  if (failing != kPower || ::fstat(descriptor, &status) != 0) return;
  ::pthread_mutex_lock(&changes_mutex);
  for (Change** change = &last_change; *change != nullptr;) {
    const bool is_safe =
        all || ((*change)->device == status.st_dev && (*change)->file == status.st_ino);
    if (is_safe) {
      *change = (*change)->before;
    } else {
      change = &(*change)->before;
    }
  }
  ::pthread_mutex_unlock(&changes_mutex);
}

template <typename Function>
Function* next(const char* name, Function* /*replaced*/) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

[[noreturn]] void refuse(const char* what) {
  std::fprintf(stderr, "faults: CAIRN_FAULT: not understood: %s\n", what);
  std::_Exit(97);
}

void read_settings() {
  const char* const log = std::getenv("CAIRN_FAULT_LOG");
  if (log != nullptr) {
    const long opened = ::syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_APPEND, 0600);
    // Out of the way of the program's own numbers, which it may count on.
    log_descriptor = static_cast<int>(::syscall(SYS_fcntl, opened, F_DUPFD_CLOEXEC, 500));
    ::syscall(SYS_close, opened);
  }
  const char* const trace_wanted = std::getenv("CAIRN_FAULT_TRACE");
  traces = trace_wanted != nullptr && *trace_wanted != '\0';
  if (traces) {  // the first call loads a library
    void* frame = nullptr;
    ::backtrace(&frame, 1);
  }
  const char* const fault = std::getenv("CAIRN_FAULT");
  if (fault == nullptr || *fault == '\0') return;
  const char* const colon = std::strchr(fault, ':');
  if (colon == nullptr) refuse(fault);
  const auto length = static_cast<std::size_t>(colon - fault);
  for (int kind = 0; kind < kKinds; ++kind) {
    if (std::strlen(kNames[kind].name) == length &&
        std::strncmp(kNames[kind].name, fault, length) == 0) {
      failing = kind;
    }
  }
  if (failing < 0) refuse(fault);
  error_number = kNames[failing].error;
  char* rest = nullptr;
  first = std::strtoull(colon + 1, &rest, 10);
  if (first == 0) refuse(fault);
  if (*rest == '+') {
    from_then_on = true;
    ++rest;
  }
  if (*rest == '\0') return;
  if (*rest != ':') refuse(fault);
  ++rest;
  if (failing == kPower && std::strcmp(rest, "some") == 0) {
    keeps_some = true;
    return;
  }
  if (std::strcmp(rest, "short") == 0) {
    if (failing != kRead && failing != kWrite) refuse(fault);
    shortened = true;
    return;
  }
  for (const ErrorOf& one : kErrors) {
    if (std::strcmp(one.name, rest) == 0) {
      error_number = one.error;
      return;
    }
  }
  refuse(fault);
}

void write_counts() {
  for (int kind = 0; kind < kKinds; ++kind) {
    char line[64];
    const int size = std::snprintf(line, sizeof line, "%s %llu\n", kNames[kind].name,
                                   static_cast<unsigned long long>(calls[kind].load()));
    write_log(line, static_cast<std::size_t>(size));
  }
}

using Main = int (*)(int, char**, char**);
Main real_main = nullptr;

int main_of_program(int argc, char** argv, char** environment) {
  read_settings();
  started = true;
  const int code = real_main(argc, argv, environment);
  before_change();
  // What runs at exit is the libraries' own, and the sanitizer's, which starts a symbolizer.
  started = false;
  ::unsetenv("LD_PRELOAD");
  write_counts();
  return code;
}

}  // namespace

extern "C" {

int __libc_start_main(Main main, int argc, char** argv, Main init, void (*fini)(),
                      void (*rtld_fini)(), void* stack_end) {
  real_main = main;
  using Start = int(Main, int, char**, Main, void (*)(), void (*)(), void*);
  return next<Start>("__libc_start_main", nullptr)(main_of_program, argc, argv, init, fini,
                                                   rtld_fini, stack_end);
}

// Memory. free() stays what it is.

void* malloc(std::size_t size) {
  return fails(kAllocate) ? nullptr : CAIRN_BEHIND(malloc)(size);
}

void* calloc(std::size_t count, std::size_t size) {
  return fails(kAllocate) ? nullptr : CAIRN_BEHIND(calloc)(count, size);
}

void* realloc(void* memory, std::size_t size) {
  return fails(kAllocate) ? nullptr : CAIRN_BEHIND(realloc)(memory, size);
}

void* memalign(std::size_t alignment, std::size_t size) {
  return fails(kAllocate) ? nullptr : CAIRN_BEHIND(memalign)(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
  return fails(kAllocate) ? nullptr : CAIRN_BEHIND(memalign)(alignment, size);
}

int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  if (fails(kAllocate)) return ENOMEM;
  void* const made = CAIRN_BEHIND(memalign)(alignment, size);
  if (made == nullptr) return ENOMEM;
  *memory = made;
  return 0;
}

// Reading.

ssize_t read(int descriptor, void* buffer, std::size_t size) {
  const ssize_t bytes = bytes_of(kRead, descriptor, size);
  return bytes < 0 ? -1 : next("read", &read)(descriptor, buffer, static_cast<std::size_t>(bytes));
}

ssize_t __read_chk(int descriptor, void* buffer, std::size_t size, std::size_t /*room*/) {
  return read(descriptor, buffer, size);
}

ssize_t pread(int descriptor, void* buffer, std::size_t size, off_t offset) {
  const ssize_t bytes = bytes_of(kRead, descriptor, size);
  return bytes < 0
             ? -1
             : next("pread", &pread)(descriptor, buffer, static_cast<std::size_t>(bytes), offset);
}

ssize_t pread64(int descriptor, void* buffer, std::size_t size, off64_t offset) {
  return pread(descriptor, buffer, size, offset);
}

ssize_t __pread64_chk(int descriptor, void* buffer, std::size_t size, off64_t offset,
                      std::size_t /*room*/) {
  return pread(descriptor, buffer, size, offset);
}

std::size_t fread(void* buffer, std::size_t size, std::size_t count, FILE* file) {
  if (::fileno(file) > STDERR_FILENO && !shortened && fails(kRead)) return 0;
  return next("fread", &fread)(buffer, size, count, file);
}

// Writing.

ssize_t write(int descriptor, const void* buffer, std::size_t size) {
  if (descriptor > STDERR_FILENO) before_change();
  const ssize_t bytes = bytes_of(kWrite, descriptor, size);
  if (bytes < 0) return -1;
  if (failing == kPower) {
    const bool appends = (next("fcntl", &fcntl)(descriptor, F_GETFL, nullptr) & O_APPEND) != 0;
    keep(descriptor, buffer, size, ::lseek(descriptor, 0, appends ? SEEK_END : SEEK_CUR));
  }
  return next("write", &write)(descriptor, buffer, static_cast<std::size_t>(bytes));
}

ssize_t pwrite(int descriptor, const void* buffer, std::size_t size, off_t offset) {
  before_change();
  const ssize_t bytes = bytes_of(kWrite, descriptor, size);
  if (bytes < 0) return -1;
  keep(descriptor, buffer, size, offset);
  return next("pwrite", &pwrite)(descriptor, buffer, static_cast<std::size_t>(bytes), offset);
}

ssize_t pwrite64(int descriptor, const void* buffer, std::size_t size, off64_t offset) {
  return pwrite(descriptor, buffer, size, offset);
}

ssize_t writev(int descriptor, const iovec* pieces, int count) {
  const ssize_t bytes = bytes_of(kWrite, descriptor, 2);
  if (bytes < 0) return -1;
  if (bytes == 1 && count > 0) return write(descriptor, pieces->iov_base, pieces->iov_len);
  return next("writev", &writev)(descriptor, pieces, count);
}

// Files.

int open(const char* path, int flags, ...) {
  mode_t mode = 0;
  if ((flags & (O_CREAT | __O_TMPFILE)) != 0) {
    std::va_list rest;
    va_start(rest, flags);
    mode = va_arg(rest, mode_t);
    va_end(rest);
  }
  return fails(kOpen) ? -1 : next("open", &open)(path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  mode_t mode = 0;
  if ((flags & (O_CREAT | __O_TMPFILE)) != 0) {
    std::va_list rest;
    va_start(rest, flags);
    mode = va_arg(rest, mode_t);
    va_end(rest);
  }
  return open(path, flags, mode);
}

int __open_2(const char* path, int flags) {
  return open(path, flags);
}

int __open64_2(const char* path, int flags) {
  return open(path, flags);
}

int openat(int folder, const char* path, int flags, ...) {
  mode_t mode = 0;
  if ((flags & (O_CREAT | __O_TMPFILE)) != 0) {
    std::va_list rest;
    va_start(rest, flags);
    mode = va_arg(rest, mode_t);
    va_end(rest);
  }
  return fails(kOpen) ? -1 : next("openat", &openat)(folder, path, flags, mode);
}

FILE* fopen(const char* path, const char* mode) {
  return fails(kOpen) ? nullptr : next("fopen", &fopen)(path, mode);
}

FILE* fopen64(const char* path, const char* mode) {
  return fopen(path, mode);
}

int close(int descriptor) {
  const int result = next("close", &close)(descriptor);  // Linux frees the number in any case
  return descriptor > STDERR_FILENO && fails(kClose) ? -1 : result;
}

int fsync(int descriptor) {
  before_change();
  if (fails(kSync)) return -1;
  forget(descriptor, false);
  return next("fsync", &fsync)(descriptor);
}

int fdatasync(int descriptor) {
  before_change();
  if (fails(kSync)) return -1;
  forget(descriptor, false);
  return next("fdatasync", &fdatasync)(descriptor);
}

int syncfs(int descriptor) noexcept {
  before_change();
  if (fails(kSync)) return -1;
  forget(descriptor, true);
  return next("syncfs", &syncfs)(descriptor);
}

int rename(const char* from, const char* to) noexcept {
  before_change();
  return fails(kRename) ? -1 : next("rename", &rename)(from, to);
}

int unlink(const char* path) noexcept {
  before_change();
  return fails(kUnlink) ? -1 : next("unlink", &unlink)(path);
}

int remove(const char* path) noexcept {
  before_change();
  return fails(kUnlink) ? -1 : next("remove", &remove)(path);
}

int unlinkat(int folder, const char* path, int flags) noexcept {
  before_change();
  return fails(kUnlink) ? -1 : next("unlinkat", &unlinkat)(folder, path, flags);
}

int mkdir(const char* path, mode_t mode) noexcept {
  return fails(kMakeFolder) ? -1 : next("mkdir", &mkdir)(path, mode);
}

int ftruncate(int descriptor, off_t size) noexcept {
  before_change();
  if (fails(kTruncate)) return -1;
  keep(descriptor, nullptr, 0, size);
  return next("ftruncate", &ftruncate)(descriptor, size);
}

int ftruncate64(int descriptor, off64_t size) noexcept {
  return ftruncate(descriptor, size);
}

int flock(int descriptor, int operation) noexcept {
  return fails(kLock) ? -1 : next("flock", &flock)(descriptor, operation);
}

int fcntl(int descriptor, int command, ...) {
  std::va_list rest;
  va_start(rest, command);
  void* const argument = va_arg(rest, void*);  // numbers are passed as wide
  va_end(rest);
  const bool locks = command == F_SETLK || command == F_SETLKW || command == F_OFD_SETLK;
  if (locks && fails(kLock)) return -1;
  return next("fcntl", &fcntl)(descriptor, command, argument);
}

int fcntl64(int descriptor, int command, ...) {
  std::va_list rest;
  va_start(rest, command);
  void* const argument = va_arg(rest, void*);
  va_end(rest);
  return fcntl(descriptor, command, argument);
}

// Memory and threads of the operating system.

void* mmap(void* address, std::size_t size, int protection, int flags, int descriptor,
           off_t offset) noexcept {
  if (fails(kMap)) return MAP_FAILED;
  return next("mmap", &mmap)(address, size, protection, flags, descriptor, offset);
}

void* mmap64(void* address, std::size_t size, int protection, int flags, int descriptor,
             off64_t offset) noexcept {
  return mmap(address, size, protection, flags, descriptor, offset);
}

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*body)(void*),
                   void* argument) noexcept {
  if (fails(kThread)) return error_number;
  return next("pthread_create", &pthread_create)(thread, attributes, body, argument);
}

}  // extern "C"

#ifdef CAIRN_FAULTS_UNDER_ADDRESS_SANITIZER

// The sanitizer's own operators would not call malloc().

namespace {

void* allocated_or_null(std::size_t size, std::align_val_t alignment = std::align_val_t(16)) {
  return memalign(static_cast<std::size_t>(alignment), size);
}

void* allocated(std::size_t size, std::align_val_t alignment = std::align_val_t(16)) {
  void* const memory = allocated_or_null(size, alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

void* operator new(std::size_t size) {
  return allocated(size);
}

void* operator new[](std::size_t size) {
  return allocated(size);
}

void* operator new(std::size_t size, const std::nothrow_t& /*throws*/) noexcept {
  return allocated_or_null(size);
}

void* operator new[](std::size_t size, const std::nothrow_t& /*throws*/) noexcept {
  return allocated_or_null(size);
}

void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocated(size, alignment);
}

void* operator new[](std::size_t size, std::align_val_t alignment) {
  return allocated(size, alignment);
}

void* operator new(std::size_t size, std::align_val_t alignment,
                   const std::nothrow_t& /*throws*/) noexcept {
  return allocated_or_null(size, alignment);
}

void* operator new[](std::size_t size, std::align_val_t alignment,
                     const std::nothrow_t& /*throws*/) noexcept {
  return allocated_or_null(size, alignment);
}

#endif
