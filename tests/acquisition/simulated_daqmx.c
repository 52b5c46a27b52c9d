/* A simulated NI-DAQmx: the entry points that the driver uses, in real time, for tests.

   Built as libnidaqmx.so.1 and found through the loader's path, so that the nidaqmx package takes its real way.
   Sample i of channel c is ((c + 1) * i) mod 65536, whatever the unit. Settings come from the environment:
   SIM_DAQMX_PPM        sample clock's error, parts per million
   SIM_DAQMX_FAIL_AT    sample from which on every read fails with ...
   SIM_DAQMX_FAIL_CODE  ... this code; -200284: no more samples come
   SIM_DAQMX_WAVE       "noise": white noise of rms SIM_DAQMX_RMS (1) with a common part, instead of the ramp;
                        "chord": the same sines on every channel, as late as the input's delay
   Modules delay as an NI-9234 does, cDAQ1Mod9 has no filter, cDAQ1Mod8 takes its delay out itself. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define TOO_LATE (-200279)
#define NOT_YET (-200284)
#define SECONDS 10364
#define MOST 64

typedef struct {
    int channels, running, module[MOST], in_seconds[MOST];
    char names[MOST][64];
    double wished, started;
    uint64_t position;
    uint32_t buffer;
} Task;

static char last_error[2048];

static double setting(const char *name, double otherwise) {
    const char *text = getenv(name);
    return text ? atof(text) : otherwise;
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static int32_t fail(int32_t code, const char *text) {
    snprintf(last_error, sizeof last_error, "%s\n\nStatus Code: %d", text, code);
    return code;
}

static double achieved(const Task *task) {
    double base = 13.1072e6 / 256, n = floor(base / task->wished + 1e-9);
    return base / (n < 1 ? 1 : n > 31 ? 31 : n);
}

static double actual(const Task *task) { return achieved(task) * (1 + 1e-6 * setting("SIM_DAQMX_PPM", 0)); }

static uint64_t acquired(const Task *task) {
    if (!task->running) return 0;
    double count = (now() - task->started) * actual(task), end = setting("SIM_DAQMX_FAIL_AT", 1e18);
    return (uint64_t)(count < end ? count : end);
}

int32_t DAQmxGetSystemInfoAttribute(int32_t attribute, uint32_t *value) {
    *value = attribute == 0x1272 ? 24 : 0;
    return 0;
}

int32_t DAQmxCreateTask(const char *name, Task **task) {
    (void)name;
    *task = calloc(1, sizeof(Task));
    return 0;
}

int32_t DAQmxGetTaskAttribute(Task *task, int32_t attribute, char *value, uint32_t size) {
    (void)task, (void)attribute;
    if (size) snprintf(value, size, "simulated");
    return size ? 0 : 10;
}

static int32_t add(Task *task, const char *terminal, const char *name) {
    if (strncmp(terminal, "cDAQ1Mod", 8))
        return fail(-200220, "Device identifier is invalid.");
    if (!strstr(terminal, "/ai"))
        return fail(-200170, "Physical channel specified does not exist on this device.");
    if (task->channels == MOST) return fail(-200489, "Too many channels.");
    task->module[task->channels] = atoi(terminal + 8);
    snprintf(task->names[task->channels], 64, "%s", name);
    task->channels++;
    return 0;
}

int32_t DAQmxCreateAIVoltageChan(Task *task, const char *terminal, const char *name, int32_t config, double low,
                                 double high, int32_t units, const char *scale) {
    (void)config, (void)low, (void)high, (void)units, (void)scale;
    return add(task, terminal, name);
}

int32_t DAQmxCreateAIAccelChan(Task *task, const char *terminal, const char *name, int32_t config, double low,
                               double high, int32_t units, double sensitivity, int32_t sensitivity_units,
                               int32_t source, double current, const char *scale) {
    (void)config, (void)low, (void)high, (void)units, (void)sensitivity, (void)sensitivity_units;
    (void)source, (void)current, (void)scale;
    return add(task, terminal, name);
}

int32_t DAQmxCreateAIForceIEPEChan(Task *task, const char *terminal, const char *name, int32_t config, double low,
                                   double high, int32_t units, double sensitivity, int32_t sensitivity_units,
                                   int32_t source, double current, const char *scale) {
    return DAQmxCreateAIAccelChan(task, terminal, name, config, low, high, units, sensitivity, sensitivity_units,
                                  source, current, scale);
}

static double delay_in_samples(const Task *task, int module) {
    return module >= 8 ? 0 : 40 + 5.0 / 512 + 2.6e-6 * achieved(task);
}

static int number_of(const Task *task, const char *name) {
    for (int c = 0; c < task->channels; c++)
        if (!strcmp(task->names[c], name)) return c;
    return -1;
}

int32_t DAQmxGetChanAttribute(Task *task, const char *name, int32_t attribute, void *value) {
    int c = number_of(task, name);
    if (c < 0) return fail(-200488, "Channel specified does not exist in the task.");
    if (attribute == 0x2fbd && task->module[c] == 8) {
        *(uint32_t *)value = 1;
        return 0;
    }
    if (attribute != 0x2fed || task->module[c] == 9) return fail(-200452, "Specified property is not supported.");
    double samples = task->module[c] == 8 ? 99 : delay_in_samples(task, task->module[c]);
    *(double *)value = task->in_seconds[c] ? samples / achieved(task) : samples;
    return 0;
}

int32_t DAQmxSetChanAttribute(Task *task, const char *name, int32_t attribute, int32_t value) {
    int c = number_of(task, name);
    if (c < 0 || attribute != 0x3071 || task->module[c] == 9)
        return fail(-200452, "Specified property is not supported.");
    task->in_seconds[c] = value == SECONDS;
    return 0;
}

int32_t DAQmxCfgSampClkTiming(Task *task, const char *source, double rate, int32_t edge, int32_t mode, uint64_t n) {
    (void)source, (void)edge, (void)mode;
    task->wished = rate;
    task->buffer = (uint32_t)n;
    return 0;
}

int32_t DAQmxGetTimingAttribute(Task *task, int32_t attribute, double *value) {
    (void)attribute;
    *value = achieved(task);
    return 0;
}

int32_t DAQmxSetBufferAttribute(Task *task, int32_t attribute, uint32_t value) {
    (void)attribute;
    task->buffer = value;
    return 0;
}

int32_t DAQmxGetBufferAttribute(Task *task, int32_t attribute, uint32_t *value) {
    (void)attribute;
    *value = task->buffer;
    return 0;
}

int32_t DAQmxGetReadAttribute(Task *task, int32_t attribute, uint64_t *value) {
    *value = attribute == 0x192a ? acquired(task) : task->position;
    return 0;
}

int32_t DAQmxStartTask(Task *task) {
    task->running = 1;
    task->started = now();
    return 0;
}

int32_t DAQmxStopTask(Task *task) {
    task->running = 0;
    return 0;
}

int32_t DAQmxClearTask(Task *task) {
    free(task);
    return 0;
}

static double noise(uint64_t i, int c) {
    uint64_t x = i * 0x9E3779B97F4A7C15ull + (uint64_t)c * 0xD1B54A32D192ED03ull;
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
    return (((x ^ (x >> 31)) >> 11) * 0x1p-53 - 0.5) * sqrt(12.0);
}

static double chord(double seconds) {
    double sum = 0;
    for (int k = 1; k <= 60; k++) sum += sin(6.283185307179586 * 64 * k * seconds + 0.37 * k * k);
    return sum;
}

static void fill(const Task *task, uint64_t n, double *values) {
    const char *wave = getenv("SIM_DAQMX_WAVE");
    int noisy = wave && !strcmp(wave, "noise"), sounding = wave && !noisy;
    double rms = setting("SIM_DAQMX_RMS", 1), rate = task->wished > 0 ? achieved(task) : 1;
    for (int c = 0; c < task->channels; c++) {
        double late = delay_in_samples(task, task->module[c]);
        for (uint64_t k = 0; k < n; k++) {
            uint64_t i = task->position + k;
            values[c * n + k] = noisy      ? rms * (0.8 * noise(i, 0) + 0.6 * noise(i, c + 1))
                                : sounding ? chord(((double)i - late) / rate)
                                           : (double)((uint64_t)(c + 1) * i % 65536);
        }
    }
}

int32_t DAQmxReadAnalogF64(Task *task, int32_t n, double timeout, int32_t mode, double *values, uint32_t size,
                           int32_t *got, void *reserved) {
    (void)mode, (void)size, (void)reserved;
    double latest = now() + timeout, fail_at = setting("SIM_DAQMX_FAIL_AT", 1e18);
    int32_t code = (int32_t)setting("SIM_DAQMX_FAIL_CODE", NOT_YET);
    *got = 0;
    for (;;) {
        uint64_t count = acquired(task);
        if (count > task->position + task->buffer)
            return fail(TOO_LATE, "The application is not able to keep up with the hardware acquisition.");
        if (count >= task->position + (uint64_t)n) break;
        if (code != NOT_YET && count >= fail_at) return fail(code, "The device is not there.");
        double wait = latest - now();
        if (wait <= 0) return fail(NOT_YET, "Some or all of the samples requested have not yet been acquired.");
        double due = (task->position + n - count) / actual(task);
        wait = due < wait ? due : wait;
        wait = wait > 0.02 ? 0.02 : wait < 1e-4 ? 1e-4 : wait;
        struct timespec pause = {0, (long)(wait * 1e9)};
        nanosleep(&pause, NULL);
    }
    fill(task, n, values);
    task->position += n;
    *got = n;
    return 0;
}

int32_t DAQmxGetErrorString(int32_t code, char *text, uint32_t size) {
    (void)code;
    snprintf(text, size, "%s", last_error);
    return 0;
}

int32_t DAQmxGetExtendedErrorInfo(char *text, uint32_t size) {
    snprintf(text, size, "%s", last_error);
    return 0;
}
