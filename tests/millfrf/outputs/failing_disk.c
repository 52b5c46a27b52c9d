/* A disk that fails, for the tests of writers: preloaded into a program, it lets calls on files below a folder fail.
 *
 * FAULT_FOLDER is the folder; nothing fails without it. FAULT is the name of the fault, FAULT_FROM the number of the call
 * from which on it is there (1: the first), FAULT_UNTIL that of the last, FAULT_ERRNO the error that is reported:
 *   write     writes and resizes fail
 *   sync      syncs of files fail
 *   folder    syncs of folders fail
 *   pulled    from the counted write on, everything fails: writes, syncs, opens, renames, removals
 *   short     each write takes half of its bytes; nothing fails
 *   removed, replaced   a file is removed, or replaced by another, as soon as it is renamed
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#define REALLY(name) ((typeof(&name))dlsym(RTLD_NEXT, #name))

static int calls;

static int is_fault(const char *name) {
    const char *fault = getenv("FAULT");
    return fault && getenv("FAULT_FOLDER") && strcmp(fault, name) == 0;
}

static int is_below(const char *path) {
    const char *folder = getenv("FAULT_FOLDER");
    return folder && path && strncmp(path, folder, strlen(folder)) == 0;
}

static int is_open_below(int descriptor) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length <= 0) return 0;
    path[length] = 0;
    return is_below(path);
}

static int number(const char *name, int otherwise) {
    const char *text = getenv(name);
    return text ? atoi(text) : otherwise;
}

static int refused(void) {
    errno = number("FAULT_ERRNO", EIO);
    return 1;
}

/* Count a call of the fault's kind; whether it fails. */
static int fails(void) {
    int call = __sync_add_and_fetch(&calls, 1);
    return call >= number("FAULT_FROM", 1) && call <= number("FAULT_UNTIL", call) && refused();
}

static int is_pulled(void) { return is_fault("pulled") && calls >= number("FAULT_FROM", 1); }

static int write_fails(int descriptor) {
    return (is_fault("write") || is_fault("pulled")) && is_open_below(descriptor) && fails();
}

static size_t taken(int descriptor, size_t length) {
    return is_fault("short") && length > 1 && is_open_below(descriptor) ? length / 2 : length;
}

ssize_t write(int descriptor, const void *bytes, size_t length) {
    if (write_fails(descriptor)) return -1;
    return REALLY(write)(descriptor, bytes, taken(descriptor, length));
}

ssize_t pwrite64(int descriptor, const void *bytes, size_t length, off_t offset) {
    if (write_fails(descriptor)) return -1;
    return REALLY(pwrite64)(descriptor, bytes, taken(descriptor, length), offset);
}

ssize_t pwrite(int descriptor, const void *bytes, size_t length, off_t offset) {
    return pwrite64(descriptor, bytes, length, offset);
}

int ftruncate64(int descriptor, off_t length) {
    return write_fails(descriptor) ? -1 : REALLY(ftruncate64)(descriptor, length);
}

int ftruncate(int descriptor, off_t length) { return ftruncate64(descriptor, length); }

int fsync(int descriptor) {
    struct stat state;
    if (is_pulled() && is_open_below(descriptor) && refused()) return -1;
    int is_folder = fstat(descriptor, &state) == 0 && S_ISDIR(state.st_mode);
    if (is_fault(is_folder ? "folder" : "sync") && is_open_below(descriptor) && fails()) return -1;
    return REALLY(fsync)(descriptor);
}

static int opened(const char *path, int flags, va_list more) {
    mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0;
    if (is_pulled() && is_below(path) && refused()) return -1;
    return REALLY(open64)(path, flags, mode);
}

int open64(const char *path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    int descriptor = opened(path, flags, more);
    va_end(more);
    return descriptor;
}

int open(const char *path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    int descriptor = opened(path, flags, more);
    va_end(more);
    return descriptor;
}

int unlink(const char *path) { return is_pulled() && is_below(path) && refused() ? -1 : REALLY(unlink)(path); }

int rename(const char *from, const char *to) {
    if (is_pulled() && is_below(to) && refused()) return -1;
    int done = REALLY(rename)(from, to);
    if (done || !is_below(to)) return done;
    if (is_fault("removed")) REALLY(unlink)(to);
    if (is_fault("replaced")) {
        char other[4096];
        snprintf(other, sizeof other, "%s.other", to);
        close(REALLY(open64)(other, O_WRONLY | O_CREAT, 0600));
        REALLY(rename)(other, to);
    }
    return done;
}
