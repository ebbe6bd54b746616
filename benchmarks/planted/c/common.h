/* A throw, times and start as a command gets them: read by free.c and eq8.c. */
#define _GNU_SOURCE
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef MISTAKE
#define MISTAKE 0
#endif

/* ---------- reading ---------- */
typedef struct { char table[32], key[64], value[128]; } Entry;
static Entry entries[256];
static int n_entries;

static void normal(char *out, const char *in, size_t size)   /* lower case, letters and digits only */
{
    size_t k = 0;
    for (; *in && k + 1 < size; in++) if (isalnum((unsigned char)*in)) out[k++] = (char)tolower((unsigned char)*in);
    out[k] = 0;
}

static void read_toml(const char *path)
{
    FILE *f = fopen(path, "r");
    char line[1024], table[32] = "";
    if (!f) { perror(path); exit(2); }
    while (fgets(line, sizeof line, f)) {
        char *p = line, *q;
        while (isspace((unsigned char)*p)) p++;
        if (*p == '[') {
            q = strrchr(p, ']'); if (q) *q = 0;
            q = strrchr(p, '.'); normal(table, q ? q + 1 : p + 1, sizeof table);
        } else if (*p && *p != '#' && (q = strchr(p, '=')) && n_entries < 256) {
            Entry *en = &entries[n_entries++];
            *q++ = 0;
            strcpy(en->table, table); normal(en->key, p, sizeof en->key);
            size_t k = 0;
            for (; *q && *q != '#' && *q != '\n' && k + 1 < sizeof en->value; q++)
                if (!isspace((unsigned char)*q) && *q != '"' && *q != '\'' && *q != '_') en->value[k++] = *q;
            en->value[k] = 0;
        }
    }
    fclose(f);
}

static const char *look(const char *table, const char *names)   /* names: "a b c", the first that is there */
{
    char list[256], *save = NULL;
    strcpy(list, names);
    for (char *name = strtok_r(list, " ", &save); name; name = strtok_r(NULL, " ", &save))
        for (int i = 0; i < n_entries; i++)
            if (!strcmp(entries[i].table, table) && !strcmp(entries[i].key, name)) return entries[i].value;
    return NULL;
}

static int number(const char *table, const char *names, double *out)
{
    const char *s = look(table, names);
    if (s) *out = strtod(s, NULL);
    return s != NULL;
}

static double need(const char *table, const char *names)
{
    double value = 0;
    if (!number(table, names, &value)) {
        fprintf(stderr, "no key of [%s] is one of: %s\nkeys:", table, names);
        for (int i = 0; i < n_entries; i++) fprintf(stderr, " %s.%s", entries[i].table, entries[i].key);
        fprintf(stderr, "\n");
        exit(2);
    }
    return value;
}

static double *read_column(const char *path, int *count)
{
    FILE *f = fopen(path, "r");
    char line[512];
    int n = 0, room = 64;
    double *a = malloc(room * sizeof *a);
    if (!f) { perror(path); exit(2); }
    if (fgets(line, sizeof line, f))
        while (fgets(line, sizeof line, f)) {
            char *end;
            double x = strtod(line, &end);
            if (end == line) continue;
            if (n == room) a = realloc(a, (room *= 2) * sizeof *a);
            a[n++] = x;
        }
    fclose(f);
    *count = n;
    return a;
}

/* ---------- the throw; names of keys in lower case without _ ---------- */
static int N, P, frozen;
static double omega0, theta0, g, alpha, e, T, Mb, L, R, Mw, fill, m, M, own, r_min, r_max;
static double *start, *times;

static void read_throw(char **argv)
{
    double x, full;
    read_toml(argv[1]);
    times = read_column(argv[2], &P);
    start = read_column(argv[3], &N);
    Mb = need("bottle", "mass bottlemass mb massbottle emptymass");
    L = need("bottle", "length l height");
    R = need("bottle", "radius r");
    omega0 = need("scenario", "omega0 omega initialomega spin w0");
    theta0 = number("scenario", "theta0 theta initialtheta angle angle0", &x) ? x : 0;
    g = number("scenario", "gravity g", &x) ? x : 0;
    T = number("scenario", "duration tend tmax time flighttime tfinal airtime", &x) ? x : times[P - 1];
    if (number("scenario", "restitution e", &x)) e = x; else e = -need("scenario", "beta");
    int has_full = number("bottle", "maxwatermass maxwater watermax watermassmax mmax fullmass fullwatermass capacity watercapacity capacitymass maxmass fullwater maximumwatermass", &full);
    int has_water = number("scenario", "watermass mw water masswater", &Mw);
    int has_fill = number("scenario", "filling fill fraction fillfraction fillingfraction mtilde fillratio level", &fill);
    if (!has_water) {
        if (number("scenario", "slicemass", &x)) { Mw = x * N; has_water = 1; }
        else if (has_full && has_fill) Mw = fill * full;
        else need("scenario", "watermass, or filling with [bottle] maxwatermass");
    }
    if (!has_fill) { if (has_full) fill = Mw / full; else need("scenario", "filling"); }
    m = Mw / N;
    M = Mb + Mw;
    if (number("scenario", "drag alpha", &x)) alpha = x;
    else if (number("scenario", "gamma damping", &x)) alpha = 2 * m * x;
    const char *ice = look("scenario", "frozen ice");
#if MISTAKE == 32
    frozen = ice ? atoi(ice) : 0;
#else
    frozen = ice && (*ice == 't' || *ice == 'T' || *ice == '1');
#endif
    r_min = fill * L / (2 * N);
#if MISTAKE == 26
    r_min = 0;
#endif
    r_max = L - r_min;
#if MISTAKE == 5
    own = Mb * (R * R / 4 + L * L / 12);
#else
    own = Mb * (R * R / 2 + L * L / 12);
#endif
#if MISTAKE == 13
    if (e == 0) e = 0.5;
#endif
#if MISTAKE == 21
    g = 9.81;
#endif
    if (r_max - r_min < 1e-12 * L) frozen = 1;      /* one slice that fills the bottle */
}
