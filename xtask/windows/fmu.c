/* fmu LIBRARY FOLDER: loads the library of an unpacked FMU (FMI 2.0), pushes the puck for half of a second, and prints the bits of the torque
   and of the puck after each step. Built for Linux and for Windows. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <windows.h>
#define OPEN(path) (void *)LoadLibraryA(path)
#define FIND(library, name) (void *)GetProcAddress((HMODULE)(library), name)
#define SCHEME "file:///"
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW)
#define FIND(library, name) dlsym(library, name)
#define SCHEME "file://"
#endif

typedef struct {
    void (*log)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} Functions;

static void log_message(void *environment, const char *name, int status, const char *category, const char *text, ...) {
    (void)environment;
    fprintf(stderr, "%s: %d: %s: %s\n", name, status, category, text);
}

static void fail(const char *what) {
    fprintf(stderr, "%s\n", what);
    exit(3);
}

/* The value of an attribute in the tag that has `mark`. */
static void attribute(const char *text, const char *mark, const char *name, char *value, size_t room) {
    const char *tag = strstr(text, mark), *from, *to;
    char key[64];
    if (!tag) fail(mark);
    while (*tag != '<') tag--;
    snprintf(key, sizeof key, " %s=\"", name);
    from = strstr(tag, key);
    if (!from) fail(name);
    from += strlen(key);
    to = strchr(from, '"');
    if ((size_t)(to - from) >= room) fail(name);
    memcpy(value, from, to - from);
    value[to - from] = 0;
}

static unsigned reference(const char *text, const char *name) {
    char mark[64], value[32];
    snprintf(mark, sizeof mark, " name=\"%s\"", name);
    attribute(text, mark, "valueReference", value, sizeof value);
    return (unsigned)strtoul(value, NULL, 10);
}

int main(int count, char **arguments) {
    static char text[1 << 20], path[4096], guid[128];
    Functions functions = {log_message, calloc, free, NULL, NULL};
    if (count != 3) return 2;
    snprintf(path, sizeof path, "%s/modelDescription.xml", arguments[2]);
    FILE *file = fopen(path, "rb");
    if (!file) fail(path);
    text[fread(text, 1, sizeof text - 1, file)] = 0;
    fclose(file);
    attribute(text, " guid=\"", "guid", guid, sizeof guid);
    unsigned hand = reference(text, "hand_torque_Nm");
    unsigned shown[2] = {reference(text, "torque_Nm"), reference(text, "puck_rad")};

    void *library = OPEN(arguments[1]);
    if (!library) fail("the library does not load");
    void *(*create)(const char *, int, const char *, const char *, const Functions *, int, int) = FIND(library, "fmi2Instantiate");
    int (*start)(void *, int, double, double, int, double) = FIND(library, "fmi2SetupExperiment");
    int (*set)(void *, const unsigned *, size_t, const double *) = FIND(library, "fmi2SetReal");
    int (*get)(void *, const unsigned *, size_t, double *) = FIND(library, "fmi2GetReal");
    int (*step)(void *, double, double, int) = FIND(library, "fmi2DoStep");
    int (*enter)(void *) = FIND(library, "fmi2EnterInitializationMode");
    int (*leave)(void *) = FIND(library, "fmi2ExitInitializationMode");
    int (*end)(void *) = FIND(library, "fmi2Terminate");
    void (*destroy)(void *) = FIND(library, "fmi2FreeInstance");
    if (!create || !start || !set || !get || !step || !enter || !leave || !end || !destroy) fail("a function is missing");

    snprintf(path, sizeof path, SCHEME "%s/resources", arguments[2]);
    void *one = create("one", 1, guid, path, &functions, 0, 1);
    if (!one) fail("no instance");
    if (start(one, 0, 0.0, 0.0, 0, 0.0) || enter(one) || leave(one)) fail("no initialisation");
    for (int k = 0; k < 1000; k++) {
        double push = k < 500 ? 0.05 : 0.0, values[2];
        uint64_t bits[2];
        if (set(one, &hand, 1, &push) || step(one, k * 1e-3, 1e-3, 1) || get(one, shown, 2, values)) fail("a step");
        memcpy(bits, values, sizeof bits);
        printf("%016llx %016llx\n", (unsigned long long)bits[0], (unsigned long long)bits[1]);
    }
    if (end(one)) fail("the end");
    destroy(one);
    return 0;
}
