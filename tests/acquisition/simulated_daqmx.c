/* A simulated NI-DAQmx: the entry points that the driver uses, in real time, for tests.

   Built as libnidaqmx.so.1 and found through the loader's path, so that the nidaqmx package takes its real way.
   At every terminal there is a voltage. A module converts it within the range that the requested limits choose; a task
   scales it by the sensitivity and into the unit of its channel. By default sample i of channel c of a task is
   ((c + 1) * i mod 65536) / 16384 V. Errors have the codes of NI-DAQmx. Settings come from the environment:
   SIM_DAQMX_PPM          sample clock's error, parts per million
   SIM_DAQMX_FAIL_AT      sample from which on every read fails with ...
   SIM_DAQMX_FAIL_CODE    ... this code; -200284: no more samples come
   SIM_DAQMX_WAVE         "noise": white noise of rms SIM_DAQMX_RMS V (1) with a common part, instead of the ramp;
                          "chord": the same sines at every terminal, sampled as late as the input delays
   SIM_DAQMX_OFFSET       V, added to every voltage; AC coupling takes it out
   SIM_DAQMX_OPEN         "first last": samples between which the loop of the task's last channel is open
   SIM_DAQMX_TRIGGER      s after the start at which the start trigger's edge comes (never)
   SIM_DAQMX_NETWORK      1: chassis are synchronized through the network
   SIM_DAQMX_RANGE, _COUPLING, _TERMINALS, _EXCITATION   what a module reports instead of its setting
   Modules 1 to 7 are as an NI 9234 (7 with a TEDS sensor at every input), 8 takes its filter's delay out itself,
   9 is as an NI 9215 and 10 as an NI 9205. Counters are those of the chassis. */

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define TOO_LATE (-200279)
#define NOT_YET (-200284)
#define BAD_VALUE (-200077)
#define NOT_SUPPORTED (-200452)
#define NO_SYNC (-201426)
#define NO_TEDS (-200709)
#define NOT_READ_FIRST (-200362)
#define NO_TERMINAL (-89120)
#define TEXT_TOO_SMALL (-200228)
#define SECONDS 10364
#define DC 10050
#define AC 10045
#define DIFF 10106
#define PSEUDO 12529
#define RSE 10083
#define NRSE 10078
#define G 9.80665
#define TEDS_MV_PER_G 98.7
#define TURNS_A_SECOND 20.0
#define MOST 64

typedef struct {
    const char *model;
    double ranges[5];
    int iepe, filter, couplings, terminals[4];
} Module;

typedef struct {
    char name[64], terminal[64];
    int module, in_seconds, coupling, terminals, overloaded;
    double range, excitation, units_per_volt, millivolts, low, high;
} Channel;

typedef struct {
    int channels, running, counter, read_status, encoder, pulses;
    Channel channel[MOST];
    char clock[128], reference[128], sync[128], trigger[128];
    double wished, started, reference_rate;
    uint64_t position, behind;
    uint32_t buffer;
} Task;

static const Module MODULES[] = {
    {"NI 9234", {5}, 1, 1, 1, {PSEUDO}},
    {"NI 9250", {5}, 1, 1, 1, {PSEUDO}},
    {"NI 9215", {10}, 0, 0, 0, {DIFF}},
    {"NI 9205", {0.2, 1, 5, 10}, 0, 0, 0, {RSE, DIFF, NRSE}},
};
static char last_error[2048], teds_asked[64];
static Task *inputs;

static const Module *module_of(int number) { return &MODULES[number == 8 ? 1 : number == 9 ? 2 : number == 10 ? 3 : 0]; }

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

static int32_t unsupported(void) { return fail(NOT_SUPPORTED, "Specified property is not supported."); }

static int32_t bad_value(void) {
    return fail(BAD_VALUE, "Requested value is not a supported value for this property.");
}

static int32_t say(const char *text, char *value, uint32_t size) {
    uint32_t needed = (uint32_t)strlen(text) + 1;
    if (!size) return (int32_t)needed;
    if (size < needed) return fail(TEXT_TOO_SMALL, "Buffer is too small to fit the string.");
    memcpy(value, text, needed);
    return 0;
}

static double achieved(const Task *task) {
    double base = 13.1072e6 / 256, n = floor(base / task->wished + 1e-9);
    return base / (n < 1 ? 1 : n > 31 ? 31 : n);
}

static double actual(const Task *task) { return achieved(task) * (1 + 1e-6 * setting("SIM_DAQMX_PPM", 0)); }

static uint64_t acquired(const Task *task) {
    if (task->counter) { /* one value at each tick of the inputs' clock, from when it was started */
        uint64_t ticks = inputs ? acquired(inputs) : 0;
        return task->running && ticks > task->behind ? ticks - task->behind : 0;
    }
    if (!task->running || now() < task->started) return 0;
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
    char names[MOST * 66] = "simulated";
    if (attribute == 0x1273) {
        names[0] = 0;
        for (int c = 0; c < task->channels; c++)
            strcat(strcat(names, c ? ", " : ""), task->channel[c].name);
    }
    return say(names, value, size);
}

static int number_of_device(const char *device, int *chassis) {
    int number = 0;
    if (sscanf(device, "cDAQ%dMod%d", chassis, &number) == 2 && *chassis <= 2) return number;
    return sscanf(device, "cDAQ%d", chassis) == 1 && *chassis <= 2 && !strchr(device, 'M') ? 0 : -1;
}

static int32_t add(Task *task, const char *terminal, const char *name, int32_t config, double low, double high,
                   double volts_per_unit, double excitation) {
    int chassis = 0, number = number_of_device(terminal, &chassis);
    if (number < 1) return fail(-200220, "Device identifier is invalid.");
    if (!strstr(terminal, "/ai"))
        return fail(-200170, "Physical channel specified does not exist on this device.");
    if (task->channels == MOST) return fail(-200489, "Too many channels.");
    const Module *module = module_of(number);
    Channel *channel = &task->channel[task->channels];
    double wanted = fmax(fabs(low), fabs(high)) * fabs(volts_per_unit) * (1 - 1e-9);
    for (int k = 0; k < 5 && !channel->range; k++)
        if (module->ranges[k] >= wanted) channel->range = module->ranges[k];
    if (!channel->range || (excitation && (!module->iepe || (excitation != 0.002 && excitation != 0.004))))
        return bad_value();
    for (int k = 0; k < 4; k++)
        if (config == -1 || (config && module->terminals[k] == config)) {
            channel->terminals = config == -1 ? module->terminals[0] : config;
            break;
        }
    if (!channel->terminals) return bad_value();
    snprintf(channel->name, 64, "%s", name);
    snprintf(channel->terminal, 64, "%s", terminal);
    channel->module = number;
    channel->coupling = excitation ? AC : DC;
    channel->excitation = excitation;
    channel->units_per_volt = 1 / volts_per_unit;
    channel->low = low, channel->high = high;
    task->channels++;
    return 0;
}

int32_t DAQmxCreateAIVoltageChan(Task *task, const char *terminal, const char *name, int32_t config, double low,
                                 double high, int32_t units, const char *scale) {
    (void)scale;
    return units == 10348 ? add(task, terminal, name, config, low, high, 1, 0) : bad_value();
}

static int32_t add_iepe(Task *task, const char *terminal, const char *name, int32_t config, double low, double high,
                        double millivolts, double volts_per_unit, int32_t source, double current) {
    if (source != 10200) return bad_value();
    int32_t code = add(task, terminal, name, config, low, high, volts_per_unit, current);
    if (!code) task->channel[task->channels - 1].millivolts = millivolts;
    return code;
}

int32_t DAQmxCreateAIAccelChan(Task *task, const char *terminal, const char *name, int32_t config, double low,
                               double high, int32_t units, double sensitivity, int32_t sensitivity_units,
                               int32_t source, double current, const char *scale) {
    (void)scale;
    double volts_per_g = sensitivity * (sensitivity_units == 12509 ? 1e-3 : 1);
    double a_g = units == 10186 ? 1 : units == 12470 ? G : 0;
    if (!a_g) return bad_value();
    return add_iepe(task, terminal, name, config, low, high, 1e3 * volts_per_g, volts_per_g / a_g, source, current);
}

int32_t DAQmxCreateAIForceIEPEChan(Task *task, const char *terminal, const char *name, int32_t config, double low,
                                   double high, int32_t units, double sensitivity, int32_t sensitivity_units,
                                   int32_t source, double current, const char *scale) {
    (void)scale;
    if (units != 15875 || sensitivity_units != 15891) return bad_value();
    return add_iepe(task, terminal, name, config, low, high, sensitivity, 1e-3 * sensitivity, source, current);
}

int32_t DAQmxConfigureTEDS(const char *terminal, const char *path) {
    int chassis = 0;
    (void)path;
    if (number_of_device(terminal, &chassis) != 7) return fail(NO_TEDS, "TEDS sensor not detected on this channel.");
    snprintf(teds_asked, 64, "%s", terminal);
    return 0;
}

int32_t DAQmxCreateTEDSAIAccelChan(Task *task, const char *terminal, const char *name, int32_t config, double low,
                                   double high, int32_t units, int32_t source, double current, const char *scale) {
    if (strcmp(teds_asked, terminal)) return fail(NO_TEDS, "TEDS sensor not configured on this channel.");
    return DAQmxCreateAIAccelChan(task, terminal, name, config, low, high, units, TEDS_MV_PER_G, 12509, source,
                                  current, scale);
}

int32_t DAQmxGetPhysicalChanAttribute(const char *terminal, int32_t attribute, uint32_t *value) {
    if (strcmp(teds_asked, terminal)) return fail(NO_TEDS, "TEDS sensor not configured on this channel.");
    *value = attribute == 0x21da ? 18 : attribute == 0x21db ? 3521 : attribute == 0x21dc ? 770011 : 1;
    return 0;
}

int32_t DAQmxGetDeviceAttribute(const char *device, int32_t attribute, void *value, uint32_t size) {
    int chassis = 0, number = number_of_device(device, &chassis);
    char text[64];
    if (number < 0) return fail(-200220, "Device identifier is invalid.");
    if (attribute == 0x631) return say(number ? module_of(number)->model : "cDAQ-9178", value, size);
    if (attribute == 0x29b7 && number) {
        snprintf(text, sizeof text, "cDAQ%d", chassis);
        return say(text, value, size);
    }
    if (attribute != 0x632) return unsupported();
    *(uint32_t *)value = 0x01A20000u + (uint32_t)(100 * chassis + number);
    return 0;
}

int32_t DAQmxGetExtCalLastDateAndTime(const char *device, uint32_t *year, uint32_t *month, uint32_t *day,
                                      uint32_t *hour, uint32_t *minute) {
    int chassis = 0;
    if (number_of_device(device, &chassis) < 1) return unsupported();
    *year = 2026, *month = 3, *day = 17, *hour = 9, *minute = 30;
    return 0;
}

int32_t DAQmxGetSelfCalLastDateAndTime(const char *device, uint32_t *year, uint32_t *month, uint32_t *day,
                                       uint32_t *hour, uint32_t *minute) {
    (void)device, (void)year, (void)month, (void)day, (void)hour, (void)minute;
    return unsupported();
}

static double delay_in_samples(const Task *task, int module) {
    return module >= 8 ? 0 : 40 + 5.0 / 512 + 2.6e-6 * achieved(task);
}

static Channel *channel_of(Task *task, const char *name) {
    for (int c = 0; c < task->channels; c++)
        if (!strcmp(task->channel[c].name, name)) return &task->channel[c];
    return NULL;
}

static int32_t filter_delay(const Task *task, const Channel *channel, double *value) {
    double samples = channel->module == 8 ? 99 : delay_in_samples(task, channel->module);
    if (!module_of(channel->module)->filter) return unsupported();
    *value = channel->in_seconds ? samples / achieved(task) : samples;
    return 0;
}

int32_t DAQmxGetChanAttribute(Task *task, const char *name, int32_t attribute, void *value) {
    Channel *channel = channel_of(task, name);
    if (!channel) return fail(-200488, "Channel specified does not exist in the task.");
    const Module *module = module_of(channel->module);
    double *real = value, reported = setting("SIM_DAQMX_RANGE", channel->range);
    int32_t *whole = value;
    switch (attribute) {
    case 0x2fbd:
        if (channel->module != 8) return unsupported();
        *whole = 1;
        return 0;
    case 0x2fed: return filter_delay(task, channel, real);
    case 0x1815: *real = reported; return 0;
    case 0x1816: *real = -reported; return 0;
    case 0x1097: *whole = (int32_t)setting("SIM_DAQMX_TERMINALS", channel->terminals); return 0;
    case 0x0064:
        if (!module->couplings) return unsupported();
        *whole = (int32_t)setting("SIM_DAQMX_COUPLING", channel->coupling);
        return 0;
    case 0x17f5:
        if (!module->iepe) return unsupported();
        *real = channel->excitation ? setting("SIM_DAQMX_EXCITATION", channel->excitation) : 0;
        return 0;
    case 0x0692:
    case 0x2f81:
        if (!channel->millivolts) return unsupported();
        *real = channel->millivolts;
        return 0;
    case 0x219c: *whole = 12509; return 0;
    case 0x2f82: *whole = 15891; return 0;
    default: return unsupported();
    }
}

int32_t DAQmxSetChanAttribute(Task *task, const char *name, int32_t attribute, ...) {
    Channel *channel = channel_of(task, name);
    if (!channel) return fail(-200488, "Channel specified does not exist in the task.");
    const Module *module = module_of(channel->module);
    va_list given;
    va_start(given, attribute);
    int real = attribute == 0x17dd || attribute == 0x17de;
    double limit = real ? va_arg(given, double) : 0;
    int32_t value = real ? 0 : va_arg(given, int32_t);
    va_end(given);
    if (real) {
        if (fabs(limit) / fabs(channel->units_per_volt) > channel->range * (1 + 1e-9)) return bad_value();
        *(attribute == 0x17dd ? &channel->high : &channel->low) = limit;
        return 0;
    }
    if (attribute == 0x0064 && module->couplings) {
        if (value != AC && value != DC) return bad_value();
        channel->coupling = value;
        return 0;
    }
    if (attribute != 0x3071 || !module->filter) return unsupported();
    channel->in_seconds = value == SECONDS;
    return 0;
}

int32_t DAQmxCfgSampClkTiming(Task *task, const char *source, double rate, int32_t edge, int32_t mode, uint64_t n) {
    (void)edge, (void)mode;
    task->wished = rate;
    task->buffer = (uint32_t)n;
    snprintf(task->clock, 128, "%s", source ? source : "");
    if (*task->clock && *task->clock != '/') return fail(NO_TERMINAL, "Source terminal to be routed could not be found.");
    if (task->counter && !strstr(task->clock, "/ai/SampleClock"))
        return fail(NO_TERMINAL, "A counter of this chassis has no sample clock of its own.");
    return 0;
}

static int32_t verified(const Task *task) {
    int first = 0, chassis = 0;
    for (int c = 0; c < task->channels && !task->counter; c++) {
        number_of_device(task->channel[c].terminal, &chassis);
        first = first ? first : chassis;
        if (chassis != first && !setting("SIM_DAQMX_NETWORK", 0) && !*task->reference)
            return fail(NO_SYNC, "Devices in this task cannot be synchronized.");
    }
    return 0;
}

int32_t DAQmxGetTimingAttribute(Task *task, int32_t attribute, void *value, uint32_t size) {
    if (verified(task)) return NO_SYNC;
    switch (attribute) {
    case 0x1344: *(double *)value = achieved(task); return 0;
    case 0x1315: *(double *)value = task->reference_rate; return 0;
    case 0x1852: return say(task->clock, value, size);
    case 0x1316: return say(task->reference, value, size);
    case 0x223d: return say(task->sync, value, size);
    case 0x2f1b: return say("/cDAQ1/ai/SampleClock", value, size);
    default: return unsupported();
    }
}

int32_t DAQmxSetTimingAttribute(Task *task, int32_t attribute, ...) {
    va_list given;
    va_start(given, attribute);
    double real = attribute == 0x1315 ? va_arg(given, double) : 0;
    const char *text = attribute == 0x1315 ? "" : va_arg(given, const char *);
    va_end(given);
    if (attribute == 0x1315)
        task->reference_rate = real;
    else if (attribute == 0x1316 || attribute == 0x223d)
        snprintf(attribute == 0x1316 ? task->reference : task->sync, 128, "%s", text);
    else
        return unsupported();
    return 0;
}

int32_t DAQmxCfgDigEdgeStartTrig(Task *task, const char *source, int32_t edge) {
    if (!strstr(source, "/PFI") || *source != '/')
        return fail(NO_TERMINAL, "Source terminal to be routed could not be found on the device.");
    if (edge != 10280 && edge != 10171) return bad_value();
    snprintf(task->trigger, 128, "%s", source);
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

static int open_now(const Task *task, uint64_t i) {
    unsigned long long first = 0, last = 0;
    const char *text = getenv("SIM_DAQMX_OPEN");
    return text && sscanf(text, "%llu %llu", &first, &last) == 2 && i >= first && i < last && task->channels;
}

static int32_t status(Task *task, int32_t attribute, void *value, uint32_t size) {
    char names[MOST * 66] = "";
    int overload = attribute == 0x2174 || attribute == 0x2175, asking = attribute == 0x2174 || attribute == 0x2a09, any = 0;
    for (int c = 0; c < task->channels; c++) any |= module_of(task->channel[c].module)->iepe;
    if (!any) return unsupported();
    if (!asking && !task->read_status) return fail(NOT_READ_FIRST, "Read the ...Exist property first.");
    for (int c = 0; c < task->channels; c++) {
        int last = c == task->channels - 1 && open_now(task, task->position ? task->position - 1 : 0);
        if (overload ? task->channel[c].overloaded & (asking ? 1 : 2) : last) {
            strcat(strcat(names, *names ? ", " : ""), task->channel[c].name);
        }
        if (overload && asking) task->channel[c].overloaded = task->channel[c].overloaded & 1 ? 2 : 0; /* clears */
    }
    task->read_status = 1;
    if (!asking) return say(names, value, size);
    *(uint32_t *)value = *names != 0;
    return 0;
}

int32_t DAQmxGetReadAttribute(Task *task, int32_t attribute, void *value, uint32_t size) {
    if (attribute == 0x2174 || attribute == 0x2175 || attribute == 0x2a09 || attribute == 0x2a0a)
        return status(task, attribute, value, size);
    if (attribute != 0x192a) return unsupported();
    *(uint64_t *)value = acquired(task);
    return 0;
}

int32_t DAQmxStartTask(Task *task) {
    if (verified(task)) return NO_SYNC;
    task->running = 1;
    task->started = now() + (*task->trigger ? setting("SIM_DAQMX_TRIGGER", 1e9) : 0);
    if (task->counter)
        task->behind = inputs ? acquired(inputs) : 0;
    else
        inputs = task;
    return 0;
}

int32_t DAQmxStopTask(Task *task) {
    task->running = 0;
    return 0;
}

int32_t DAQmxClearTask(Task *task) {
    if (inputs == task) inputs = NULL;
    free(task);
    return 0;
}

static int32_t add_counter(Task *task, const char *counter, const char *name) {
    if (!strstr(counter, "ctr")) return fail(-200170, "Physical channel specified does not exist on this device.");
    snprintf(task->channel[0].name, 64, "%s", name);
    task->counter = task->channels = 1;
    return 0;
}

int32_t DAQmxCreateCIAngEncoderChan(Task *task, const char *counter, const char *name, int32_t decoding, uint32_t index,
                                    double index_value, int32_t phase, int32_t units, uint32_t pulses, double initial,
                                    const char *scale) {
    (void)index, (void)index_value, (void)phase, (void)initial, (void)scale;
    int edges = decoding == 10090 ? 1 : decoding == 10091 ? 2 : decoding == 10092 ? 4 : 0;
    if (!edges || units != 10273) return bad_value();
    task->encoder = 1;
    task->pulses = (int)pulses * edges;
    return add_counter(task, counter, name);
}

int32_t DAQmxCreateCICountEdgesChan(Task *task, const char *counter, const char *name, int32_t edge, uint32_t initial,
                                    int32_t direction) {
    (void)edge, (void)initial, (void)direction;
    return add_counter(task, counter, name);
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
    return 0.1 * sum;
}

static double convert(Channel *channel, double volts) {
    double most = 1.02 * channel->range;
    if (channel->coupling == AC) volts -= setting("SIM_DAQMX_OFFSET", 0);
    if (fabs(volts) > channel->range) channel->overloaded |= 1;
    return channel->units_per_volt * (volts > most ? most : volts < -most ? -most : volts);
}

static void fill(Task *task, uint64_t n, double *values) {
    const char *wave = getenv("SIM_DAQMX_WAVE");
    int noisy = wave && !strcmp(wave, "noise"), sounding = wave && !noisy;
    double rms = setting("SIM_DAQMX_RMS", 1), rate = achieved(task), offset = setting("SIM_DAQMX_OFFSET", 0);
    for (int c = 0; c < task->channels; c++) {
        double late = delay_in_samples(task, task->channel[c].module);
        for (uint64_t k = 0; k < n; k++) {
            uint64_t i = task->position + k;
            double volts = noisy      ? rms * (0.8 * noise(i, 0) + 0.6 * noise(i, c + 1))
                           : sounding ? chord(((double)i - late) / rate)
                                      : (double)((uint64_t)(c + 1) * i % 65536) / 16384;
            if (c == task->channels - 1 && open_now(task, i)) volts = 0;
            values[c * n + k] = convert(&task->channel[c], volts + offset);
        }
    }
}

static int32_t waited(Task *task, int32_t n, double timeout) {
    double latest = now() + timeout, fail_at = setting("SIM_DAQMX_FAIL_AT", 1e18);
    int32_t code = (int32_t)setting("SIM_DAQMX_FAIL_CODE", NOT_YET);
    for (;;) {
        uint64_t count = acquired(task);
        if (count > task->position + task->buffer)
            return fail(TOO_LATE, "The application is not able to keep up with the hardware acquisition.");
        if (count >= task->position + (uint64_t)n) return 0;
        if (code != NOT_YET && count >= fail_at) return fail(code, "The device is not there.");
        double wait = latest - now();
        if (wait <= 0) return fail(NOT_YET, "Some or all of the samples requested have not yet been acquired.");
        double due = (task->position + n - count) / actual(task);
        wait = due < wait ? due : wait;
        wait = wait > 0.02 ? 0.02 : wait < 1e-4 ? 1e-4 : wait;
        struct timespec pause = {0, (long)(wait * 1e9)};
        nanosleep(&pause, NULL);
    }
}

int32_t DAQmxReadAnalogF64(Task *task, int32_t n, double timeout, int32_t mode, double *values, uint32_t size,
                           int32_t *got, void *reserved) {
    (void)mode, (void)size, (void)reserved;
    *got = 0;
    int32_t code = waited(task, n, timeout);
    if (code) return code;
    fill(task, n, values);
    task->position += n;
    *got = n;
    return 0;
}

int32_t DAQmxReadCounterF64Ex(Task *task, int32_t n, double timeout, int32_t mode, double *values, uint32_t size,
                              int32_t *got, void *reserved) {
    (void)mode, (void)size, (void)reserved;
    *got = 0;
    int32_t code = waited(task, n, timeout);
    if (code) return code;
    for (int32_t k = 0; k < n; k++) {
        double turns = TURNS_A_SECOND * (double)(task->behind + task->position + k) / achieved(task);
        values[k] = task->encoder ? 6.283185307179586 * floor(turns * task->pulses) / task->pulses : floor(turns);
    }
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
