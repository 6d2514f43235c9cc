/* Preloaded into the command: counts the calls that write files below FAULT_BELOW (or those that read them, with FAULT_KIND=read), and
   makes call number FAULT_AT fail. Without FAULT_AT it only counts; the count is the text of FAULT_COUNT at the end of the process.

   full    every write from this one on fails with ENOSPC
   once    this one fails with EIO
   short   this one writes one byte of many
   read    this read fails with EIO
   kill    SIGKILL instead of this write */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static const char *below, *kind, *count_file;
static long at;
static atomic_long calls;
static pid_t owner;

__attribute__((constructor)) static void begin(void) {
    const char *text = getenv("FAULT_AT");
    below = getenv("FAULT_BELOW");
    kind = getenv("FAULT_KIND") ? getenv("FAULT_KIND") : "";
    count_file = getenv("FAULT_COUNT");
    at = text ? atol(text) : 0;
    owner = getpid();
}

static ssize_t (*real_write(void))(int, const void *, size_t) {
    static ssize_t (*real)(int, const void *, size_t);
    if (!real) real = dlsym(RTLD_NEXT, "write");
    return real;
}

__attribute__((destructor)) static void end(void) {
    if (!count_file || getpid() != owner) return;
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, "open64");
    int file = real(count_file, O_WRONLY | O_CREAT | O_TRUNC, 0644);
    char text[32];
    int len = snprintf(text, sizeof text, "%ld", (long)calls);
    if (file >= 0) real_write()(file, text, (size_t)len), close(file);
}

static int is_below(const char *path) {
    return below && !strncmp(path, below, strlen(below));
}

static int is_file_below(int file) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t len = readlink(link, path, sizeof path - 1);
    if (len < 0) return 0;
    path[len] = 0;
    return is_below(path);
}

/* A path relative to the current folder, as a file of it. */
static int is_path_below(int folder, const char *path) {
    char full[8192];
    if (path[0] == '/') return is_below(path);
    if (folder != AT_FDCWD) return is_file_below(folder);
    if (!getcwd(full, 4096)) return 0;
    strcat(full, "/");
    return is_below(strncat(full, path, 4000));
}

/* Whether this call fails; errno is then set. 2: it is short. */
static int fails(int reads) {
    if (reads != !strcmp(kind, "read")) return 0;
    long number = ++calls;
    if (!at || number < at || (number > at && strcmp(kind, "full"))) return 0;
    if (!strcmp(kind, "kill")) kill(getpid(), SIGKILL);
    if (!strcmp(kind, "short")) return 2;
    errno = !strcmp(kind, "full") ? ENOSPC : EIO;
    return 1;
}

#define REAL(type, name, ...) \
    static type (*real)(__VA_ARGS__); \
    if (!real) real = dlsym(RTLD_NEXT, name)

ssize_t write(int file, const void *bytes, size_t len) {
    int fault = is_file_below(file) ? fails(0) : 0;
    return fault == 1 ? -1 : real_write()(file, bytes, fault == 2 && len > 1 ? 1 : len);
}

ssize_t writev(int file, const struct iovec *parts, int count) {
    REAL(ssize_t, "writev", int, const struct iovec *, int);
    int fault = is_file_below(file) ? fails(0) : 0;
    if (fault == 2 && count > 0 && parts[0].iov_len > 0) return real_write()(file, parts[0].iov_base, 1);
    return fault == 1 ? -1 : real(file, parts, count);
}

ssize_t pwrite64(int file, const void *bytes, size_t len, off_t offset) {
    REAL(ssize_t, "pwrite64", int, const void *, size_t, off_t);
    int fault = is_file_below(file) ? fails(0) : 0;
    return fault == 1 ? -1 : real(file, bytes, fault == 2 && len > 1 ? 1 : len, offset);
}

ssize_t copy_file_range(int from, off64_t *a, int to, off64_t *b, size_t len, unsigned flags) {
    REAL(ssize_t, "copy_file_range", int, off64_t *, int, off64_t *, size_t, unsigned);
    int fault = is_file_below(to) ? fails(0) : 0;
    return fault == 1 ? -1 : real(from, a, to, b, fault == 2 && len > 1 ? 1 : len, flags);
}

int fsync(int file) {
    REAL(int, "fsync", int);
    return is_file_below(file) && fails(0) == 1 ? -1 : real(file);
}

int fdatasync(int file) {
    REAL(int, "fdatasync", int);
    return is_file_below(file) && fails(0) == 1 ? -1 : real(file);
}

int rename(const char *from, const char *to) {
    REAL(int, "rename", const char *, const char *);
    return is_path_below(AT_FDCWD, to) && fails(0) == 1 ? -1 : real(from, to);
}

int linkat(int a, const char *from, int b, const char *to, int flags) {
    REAL(int, "linkat", int, const char *, int, const char *, int);
    return is_path_below(b, to) && fails(0) == 1 ? -1 : real(a, from, b, to, flags);
}

int mkdir(const char *path, mode_t mode) {
    REAL(int, "mkdir", const char *, mode_t);
    return is_path_below(AT_FDCWD, path) && fails(0) == 1 ? -1 : real(path, mode);
}

int open64(const char *path, int flags, ...) {
    REAL(int, "open64", const char *, int, ...);
    va_list list;
    va_start(list, flags);
    mode_t mode = flags & O_CREAT ? va_arg(list, mode_t) : 0;
    va_end(list);
    return flags & O_CREAT && is_path_below(AT_FDCWD, path) && fails(0) == 1 ? -1 : real(path, flags, mode);
}

ssize_t read(int file, void *bytes, size_t len) {
    REAL(ssize_t, "read", int, void *, size_t);
    return is_file_below(file) && fails(1) == 1 ? -1 : real(file, bytes, len);
}

ssize_t pread64(int file, void *bytes, size_t len, off_t offset) {
    REAL(ssize_t, "pread64", int, void *, size_t, off_t);
    return is_file_below(file) && fails(1) == 1 ? -1 : real(file, bytes, len, offset);
}
