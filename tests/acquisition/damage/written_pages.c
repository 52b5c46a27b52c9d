/* A log of every write, resize and sync of one file, for the tests of power failures.
 *
 * Preloaded into a writer; WRITTEN_FILE ends the name of the file that is watched, WRITTEN_LOG names the log. A record is
 * kind (1 write, 2 resize, 3 sync, 4 note), offset and length, 8 bytes each, and then the bytes written.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int log_descriptor = -1;

typedef ssize_t (*write_at)(int, const void *, size_t, off_t);
typedef ssize_t (*plain_write)(int, const void *, size_t);
typedef int (*resize)(int, off_t);
typedef int (*sync_file)(int);

static int is_watched(int descriptor) {
    const char *wanted = getenv("WRITTEN_FILE");
    char link[64], name[4096];
    if (!wanted) return 0;
    strcpy(link, "/proc/self/fd/");
    char digits[16];
    int n = 0, value = descriptor;
    do { digits[n++] = (char)('0' + value % 10); value /= 10; } while (value);
    char *end = link + strlen(link);
    while (n) *end++ = digits[--n];
    *end = 0;
    ssize_t length = readlink(link, name, sizeof name - 1);
    if (length <= 0) return 0;
    name[length] = 0;
    size_t size = strlen(wanted);
    return (size_t)length >= size && strcmp(name + length - size, wanted) == 0;
}

static void whole(const void *bytes, size_t length) {
    static plain_write really;
    if (!really) really = (plain_write)dlsym(RTLD_NEXT, "write");
    const char *at = bytes;
    while (length) {
        ssize_t done = really(log_descriptor, at, length);
        if (done <= 0) abort();
        at += done;
        length -= (size_t)done;
    }
}

static void note(uint64_t kind, uint64_t offset, uint64_t length, const void *bytes) {
    uint64_t head[3] = {kind, offset, length};
    if (log_descriptor < 0) log_descriptor = open(getenv("WRITTEN_LOG"), O_WRONLY | O_CREAT | O_APPEND, 0600);
    whole(head, sizeof head);
    if (bytes) whole(bytes, length);
}

ssize_t pwrite64(int descriptor, const void *bytes, size_t length, off_t offset) {
    static write_at really;
    if (!really) really = (write_at)dlsym(RTLD_NEXT, "pwrite64");
    if (!is_watched(descriptor)) return really(descriptor, bytes, length, offset);
    pthread_mutex_lock(&lock);
    ssize_t done = really(descriptor, bytes, length, offset);
    if (done > 0) note(1, (uint64_t)offset, (uint64_t)done, bytes);
    pthread_mutex_unlock(&lock);
    return done;
}

ssize_t pwrite(int descriptor, const void *bytes, size_t length, off_t offset) {
    return pwrite64(descriptor, bytes, length, offset);
}

ssize_t write(int descriptor, const void *bytes, size_t length) {
    static plain_write really;
    if (!really) really = (plain_write)dlsym(RTLD_NEXT, "write");
    if (!is_watched(descriptor)) return really(descriptor, bytes, length);
    pthread_mutex_lock(&lock);
    off_t offset = lseek(descriptor, 0, SEEK_CUR);
    ssize_t done = really(descriptor, bytes, length);
    if (done > 0) note(1, (uint64_t)offset, (uint64_t)done, bytes);
    pthread_mutex_unlock(&lock);
    return done;
}

int ftruncate64(int descriptor, off_t length) {
    static resize really;
    if (!really) really = (resize)dlsym(RTLD_NEXT, "ftruncate64");
    pthread_mutex_lock(&lock);
    int done = really(descriptor, length);
    if (!done && is_watched(descriptor)) note(2, (uint64_t)length, 0, NULL);
    pthread_mutex_unlock(&lock);
    return done;
}

int ftruncate(int descriptor, off_t length) { return ftruncate64(descriptor, length); }

int fsync(int descriptor) {
    static sync_file really;
    if (!really) really = (sync_file)dlsym(RTLD_NEXT, "fsync");
    pthread_mutex_lock(&lock);
    int done = really(descriptor);
    if (!done && is_watched(descriptor)) note(3, 0, 0, NULL);
    pthread_mutex_unlock(&lock);
    return done;
}

/* What the writer acknowledges, in order with what it writes. */
void acknowledge(uint64_t rows) {
    pthread_mutex_lock(&lock);
    note(4, rows, 0, NULL);
    pthread_mutex_unlock(&lock);
}
