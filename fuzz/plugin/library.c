/* An algorithm library whose descriptor, table and results are cut out of the fuzzer's bytes.
 *
 * Only what the header lets the controller rely on is kept: texts end in a zero, tables are as long as they may at most be.
 * Everything else (null, wrong sizes and versions, texts that are no UTF-8, NaN) is up to the fuzzer.
 */
#include "airbench_algorithm.h"

#include <stddef.h>
#include <string.h>

#define ENTRIES AIRBENCH_MOST_PARAMETERS
#define TEXTS (3 * ENTRIES + 2)
#define LONGEST 300

static struct airbench_algorithm descriptor;
static struct airbench_parameter table[ENTRIES];
static char texts[TEXTS][LONGEST];
static int has_descriptor, has_instance, state;
static double result;

static const uint8_t *left;
static size_t count;

static void take(void *into, size_t size)
{
    size_t some = size < count ? size : count;
    memset(into, 0, size);
    memcpy(into, left, some);
    left += some;
    count -= some;
}

static uint8_t byte(void)
{
    uint8_t one;
    take(&one, 1);
    return one;
}

/* A text of up to 299 bytes; null when its length is 255. */
static const char *text(int place)
{
    uint8_t length = byte();
    if (length == 255)
        return NULL;
    take(texts[place], length == 254 ? LONGEST - 1 : length);
    texts[place][length == 254 ? LONGEST - 1 : length] = 0;
    return texts[place];
}

static void *create(const struct airbench_rig *rig)
{
    return rig->stroke_m > 0 && has_instance ? &state : NULL;
}

static void destroy(void *self)
{
    (void)self;
}

static void reset(void *self, const struct airbench_ready *ready, const double *parameters)
{
    (void)self, (void)ready;
    for (uint32_t i = 0; i < descriptor.parameter_count; i++)
        result += 0 * parameters[i];
}

static double step(void *self, const struct airbench_ready *ready, const double *parameters)
{
    (void)self, (void)parameters;
    return result * ready->period_s;
}

AIRBENCH_EXPORT void fuzz_set(const uint8_t *data, size_t size)
{
    uint8_t flags;
    uint32_t number;
    left = data;
    count = size;
    flags = byte();
    has_descriptor = !(flags & 1);
    has_instance = !(flags & 2);
    take(&number, sizeof number);
    descriptor.interface_version = flags & 4 ? number : AIRBENCH_INTERFACE_VERSION;
    descriptor.struct_size = flags & 8 ? number : (uint32_t)sizeof descriptor;
    descriptor.controls = byte();
    number = byte();
    descriptor.parameter_count = flags & 16 ? number * 0x01010101u : number;
    descriptor.name = text(0);
    descriptor.about = text(1);
    take(&result, sizeof result);
    number = byte();
    descriptor.parameters = number & 1 ? NULL : table;
    descriptor.create = number & 2 ? NULL : create;
    descriptor.destroy = number & 4 ? NULL : destroy;
    descriptor.reset = number & 8 ? NULL : reset;
    descriptor.step = number & 16 ? NULL : step;
    for (int i = 0; i < (int)ENTRIES; i++) {
        table[i].name = text(3 * i + 2);
        table[i].unit = text(3 * i + 3);
        table[i].meaning = text(3 * i + 4);
        take(&table[i].least, sizeof table[i].least);
        take(&table[i].most, sizeof table[i].most);
        take(&table[i].default_value, sizeof table[i].default_value);
    }
}

AIRBENCH_EXPORT const struct airbench_algorithm *airbench_algorithm_entry(uint32_t interface_version)
{
    (void)interface_version;
    return has_descriptor ? &descriptor : NULL;
}
