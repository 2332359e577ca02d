/* Terms: interned ones, which states are made of, and those of a computation, on a heap. Part of agent.c. */

/* Rows of numbers, each kept once and known by its own number from then on */
typedef struct {
    int *data, *slots;
    long *at, size, used;
    int n, room, nslots;
} Pool;
static unsigned gw_hash(const int *row, int n) {
    unsigned h = 2166136261u;
    while (n--) h = (h ^ (unsigned)*row++) * 16777619u, h ^= h >> 15;
    return h;
}
static void *gw_grown(void *old, size_t size) {
    void *new = realloc(old, size);
    if (!new) gw_give_up("no memory");
    return new;
}
static const int *gw_row(const Pool *p, int i, int *n) {
    *n = p->at[i + 1] - p->at[i];
    return p->data + p->at[i];
}
static int gw_intern(Pool *p, const int *row, int n) {
    unsigned at;
    int i, m, *old = p->slots;
    if (p->nslots <= 2 * p->n) {
        p->nslots = p->nslots ? 4 * p->nslots : 1024;
        p->slots = gw_grown(0, p->nslots * sizeof(int));
        memset(p->slots, -1, p->nslots * sizeof(int));
        for (i = 0; i < p->n; i++) {
            const int *known = gw_row(p, i, &m);
            for (at = gw_hash(known, m) % p->nslots; p->slots[at] >= 0; at = (at + 1) % p->nslots);
            p->slots[at] = i;
        }
        free(old);
    }
    for (at = gw_hash(row, n) % p->nslots; p->slots[at] >= 0; at = (at + 1) % p->nslots) {
        const int *known = gw_row(p, p->slots[at], &m);
        if (m == n && !memcmp(known, row, n * sizeof(int))) return p->slots[at];
    }
    if (p->n + 2 > p->room) {
        p->room = p->room ? 2 * p->room : 512;
        p->at = gw_grown(p->at, p->room * sizeof(long));
        p->at[0] = 0;
    }
    while (p->used + n > p->size) {
        p->size = p->size ? 2 * p->size : 4096;
        p->data = gw_grown(p->data, p->size * sizeof(int));
    }
    memcpy(p->data + p->used, row, n * sizeof(int));
    p->used += n;
    p->at[p->n + 1] = p->used;
    p->slots[at] = p->n;
    return p->n++;
}

/* Names: those of the program, then those that are computed */
static const char **gw_names;
static int gw_nnames, gw_nameroom;
static int gw_name(const char *text) {
    int i;
    if (!gw_nameroom) {
        gw_names = gw_grown(0, (gw_nameroom = NNAMES + 64) * sizeof *gw_names);
        memcpy(gw_names, names, NNAMES * sizeof *names);
        gw_nnames = NNAMES;
    }
    for (i = 0; text && i < gw_nnames; i++)
        if (!strcmp(gw_names[i], text)) return i;
    if (!text) return 0;
    if (gw_nnames > 20000) gw_give_up("too many numbers and texts");
    if (gw_nnames == gw_nameroom) gw_names = gw_grown(gw_names, (gw_nameroom *= 2) * sizeof *gw_names);
    gw_names[gw_nnames] = strdup(text);
    return gw_nnames++;
}

/* Interned terms: functor, then arguments. Variables have the functor FREE and a number. */
#define FREE (-1)
typedef struct {
    int ground;
    char *text;
} Shown;
static Pool gw_terms;
static Shown *gw_shown;
static int gw_shownroom;
#define VARIABLE '\1'
static char *gw_join(const char *a, const char *b, const char *c) { /* a text of its own */
    char *text = gw_grown(0, strlen(a) + strlen(b) + strlen(c) + 1);
    return strcat(strcat(strcpy(text, a), b), c);
}
static char *gw_longer(char *text, const char *b, const char *c) {
    char *joined = gw_join(text, b, c);
    free(text);
    return joined;
}
static char *gw_text_of(const int *t, int n) {
    int i, m;
    char *text;
    if (*t == FREE) return strdup("\1");
    if (*t == CONS && n == 3) {
        text = gw_join("[", gw_shown[t[1]].text, "");
        for (i = t[2];;) {
            const int *rest = gw_row(&gw_terms, i, &m);
            if (*rest != CONS || m != 3) break;
            text = gw_longer(text, ",", gw_shown[rest[1]].text);
            i = rest[2];
        }
        return strcmp(gw_shown[i].text, "[]") ? gw_longer(gw_longer(text, "|", gw_shown[i].text), "]", "")
                                              : gw_longer(text, "]", "");
    }
    text = gw_join(gw_names[*t], n > 1 ? "(" : "", "");
    for (i = 1; i < n; i++) text = gw_longer(text, i > 1 ? "," : "", gw_shown[t[i]].text);
    return n > 1 ? gw_longer(text, ")", "") : text;
}
static int gw_term(const int *t, int n) {
    int i, number = gw_intern(&gw_terms, t, n);
    if (number < gw_shownroom && gw_shown[number].text) return number;
    if (number >= 200000) gw_give_up("too many terms");
    if (number >= gw_shownroom) {
        int old = gw_shownroom;
        gw_shownroom = old ? 2 * old : 512;
        gw_shown = gw_grown(gw_shown, gw_shownroom * sizeof *gw_shown);
        memset(gw_shown + old, 0, (gw_shownroom - old) * sizeof *gw_shown);
    }
    gw_shown[number].ground = *t != FREE;
    for (i = 1; *t != FREE && i < n; i++) gw_shown[number].ground &= gw_shown[t[i]].ground;
    gw_shown[number].text = gw_text_of(t, n);
    if (strlen(gw_shown[number].text) > 20000) gw_give_up("a term that grows");
    return number;
}
static int gw_atom(const char *text) {
    int name = gw_name(text);
    return gw_term(&name, 1);
}
/* The order of two texts; that of a variable is nobody's to say */
static int gw_order(const char *u, const char *v) {
    for (; *u && *u == *v; u++, v++);
    if (*u != *v && (*u == VARIABLE || *v == VARIABLE)) gw_give_up("terms with variables in an order");
    return (unsigned char)*u - (unsigned char)*v;
}
static int gw_before(int t, int u) { return gw_order(gw_shown[t].text, gw_shown[u].text) < 0; }

/* The heap. A term there (an int, like all terms) is below 0; from 0 on it is an interned one without variables. */
#define UNBOUND (-2000000000)
typedef struct {
    int functor, n, ref, args[MAXARGS];
} Node;
static Node *gw_heap;
static int gw_top, gw_heaproom, gw_trail[200000], gw_ntrail;
#define NODE(t) gw_heap[-1 - (t)]
static int gw_node(int functor, int n) {
    if (gw_top == gw_heaproom) gw_heap = gw_grown(gw_heap, (gw_heaproom = gw_heaproom ? 2 * gw_heaproom : 4096) * sizeof(Node));
    if (gw_top == 4000000) gw_give_up("too much to derive");
    gw_heap[gw_top].functor = functor;
    gw_heap[gw_top].n = n;
    gw_heap[gw_top].ref = UNBOUND;
    return -1 - gw_top++;
}
static int gw_deref(int t) {
    while (t < 0 && NODE(t).functor == FREE && NODE(t).ref != UNBOUND) t = NODE(t).ref;
    return t;
}
static int gw_isvar(int t) { return t < 0 && NODE(t).functor == FREE; }
static int gw_functor(int t) {
    int n;
    return t < 0 ? NODE(t).functor : *gw_row(&gw_terms, t, &n);
}
static int gw_arity(int t) {
    int n;
    if (t < 0) return NODE(t).n;
    gw_row(&gw_terms, t, &n);
    return n - 1;
}
static int gw_arg(int t, int i) {
    int n;
    return gw_deref(t < 0 ? NODE(t).args[i] : gw_row(&gw_terms, t, &n)[i + 1]);
}
static void gw_undo(int trail) {
    while (gw_ntrail > trail) gw_heap[gw_trail[--gw_ntrail]].ref = UNBOUND;
}
static int gw_unify(int a, int b) { /* what it bound stays bound if it fails: undo it */
    int i;
    a = gw_deref(a);
    b = gw_deref(b);
    if (a == b) return 1;
    if (gw_isvar(b) && !gw_isvar(a)) i = a, a = b, b = i;
    if (gw_isvar(a)) {
        if (gw_ntrail == 200000) gw_give_up("too much to derive");
        NODE(a).ref = b;
        gw_trail[gw_ntrail++] = -1 - a;
        return 1;
    }
    if ((a >= 0 && b >= 0) || gw_functor(a) != gw_functor(b) || gw_arity(a) != gw_arity(b)) return 0;
    for (i = 0; i < gw_arity(a); i++)
        if (!gw_unify(gw_arg(a, i), gw_arg(b, i))) return 0;
    return 1;
}
static int gw_unifies(int a, int b) { /* whether they do; nothing stays bound */
    int trail = gw_ntrail, found = gw_unify(a, b);
    gw_undo(trail);
    return found;
}
/* An interned term on the heap: its variables by `own`, or new ones */
static int gw_import(int t, int *own) {
    int i, n, r, map[MAXFREE];
    if (gw_shown[t].ground) return t;
    if (!own)
        for (own = map, i = 0; i < MAXFREE; i++) map[i] = UNBOUND;
    const int *row = gw_row(&gw_terms, t, &n);
    if (*row == FREE) {
        if (own[row[1]] == UNBOUND) own[row[1]] = gw_node(FREE, 0);
        return own[row[1]];
    }
    r = gw_node(*row, n - 1);
    for (i = 1; i < n; i++) {
        int arg = gw_import(gw_row(&gw_terms, t, &n)[i], own);
        NODE(r).args[i - 1] = arg;
    }
    return r;
}
/* A term of the heap interned: variables get numbers in the order in which they are met; `order` remembers them */
typedef struct {
    int n, var[MAXFREE];
} Order;
static int gw_export(int t, Order *order) {
    int i, row[MAXARGS + 1];
    Order own;
    t = gw_deref(t);
    if (t >= 0) return t;
    if (!order) own.n = 0, order = &own;
    if (gw_isvar(t)) {
        for (i = 0; i < order->n && order->var[i] != t; i++);
        if (i == MAXFREE) gw_give_up("too many free variables");
        if (i == order->n) order->var[order->n++] = t;
        row[0] = FREE;
        row[1] = i;
        return gw_term(row, 2);
    }
    row[0] = NODE(t).functor;
    for (i = 0; i < NODE(t).n; i++) row[i + 1] = gw_export(NODE(t).args[i], order);
    return gw_term(row, NODE(t).n + 1);
}
/* A term of the program, with the variables of one use of its plan or rule */
static int gw_build(int p, int *env) {
    static int ground[NPATS]; /* those without variables: their numbers and 1 more */
    int i, r, row[MAXARGS + 1];
    const Pat *pat = &pats[p];
    if (pat->functor == FREE) {
        if (env[pat->args[0]] == UNBOUND) env[pat->args[0]] = gw_node(FREE, 0);
        return env[pat->args[0]];
    }
    if (ground[p]) return ground[p] - 1;
    if (pat->ground) {
        row[0] = pat->functor;
        for (i = 0; i < pat->n; i++) row[i + 1] = gw_build(pat->args[i], env);
        return (ground[p] = gw_term(row, pat->n + 1) + 1) - 1;
    }
    r = gw_node(pat->functor, pat->n);
    for (i = 0; i < pat->n; i++) {
        int arg = gw_build(pat->args[i], env);
        NODE(r).args[i] = arg;
    }
    return r;
}
static void gw_unbound(int *env) {
    int i;
    for (i = 0; i < MAXVARS; i++) env[i] = UNBOUND;
}

/* Numbers and texts */
static int gw_number(int t, double *value) {
    const char *text, *c;
    char *end;
    t = gw_deref(t);
    if (gw_isvar(t) || gw_arity(t)) return 0;
    text = gw_names[gw_functor(t)];
    for (c = text; *c; c++)
        if (!strchr("0123456789.+-eE", *c)) return 0;
    if (c == text || c[-1] < '0' || c[-1] > '9') return 0;
    *value = strtod(text, &end);
    return !*end;
}
static int gw_value(int t, double *value) { /* of an arithmetic expression */
    double x, y;
    const char *op;
    t = gw_deref(t);
    if (gw_isvar(t)) return 0;
    op = gw_names[gw_functor(t)];
    if (gw_arity(t) != 2 || !*op || op[1] || !strchr("+-*/%", *op)) return gw_number(t, value);
    if (!gw_value(gw_arg(t, 0), &x) || !gw_value(gw_arg(t, 1), &y)) return 0;
    *value = *op == '+' ? x + y : *op == '-' ? x - y : *op == '*' ? x * y : *op == '/' ? x / y : fmod(x, y);
    return 1;
}
static int gw_numeral(double value) { /* 4.0 is 4 */
    char text[64];
    int digits;
    if (value == floor(value) && fabs(value) < 1e15) {
        sprintf(text, "%.0f", value);
        return gw_atom(strcmp(text, "-0") ? text : "0");
    }
    for (digits = 1; digits < 17; digits++) {
        sprintf(text, "%.*g", digits, value);
        if (strtod(text, 0) == value) break;
    }
    sprintf(text, "%.*g", digits, value);
    if (strpbrk(text, "einf") || !strchr(text, '.')) gw_give_up("a number that is very large or small");
    return gw_atom(text);
}
static int gw_computed(int t) { /* with the values of the arithmetic expressions in it */
    double value;
    int i, r;
    t = gw_deref(t);
    if (gw_isvar(t) || !gw_arity(t)) return t;
    if (gw_value(t, &value)) return gw_numeral(value);
    r = gw_node(gw_functor(t), gw_arity(t));
    for (i = 0; i < gw_arity(t); i++) {
        int arg = gw_computed(gw_arg(t, i));
        NODE(r).args[i] = arg;
    }
    return r;
}
static const char *gw_quoted(int t) { /* a text in quotes, or 0 */
    const char *text;
    t = gw_deref(t);
    if (gw_isvar(t) || gw_arity(t)) return 0;
    text = gw_names[gw_functor(t)];
    return *text == '"' || *text == '\'' ? text : 0;
}
static int gw_inner(int t) { /* a text without its quotes, as a name; anything else as it is */
    const char *text = gw_quoted(t);
    char *bare;
    int found;
    if (!text) return t;
    bare = strdup(text + 1);
    if (*bare) bare[strlen(bare) - 1] = 0;
    found = gw_atom(bare);
    free(bare);
    return found;
}
