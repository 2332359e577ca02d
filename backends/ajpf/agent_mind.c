/* Terms, intentions, beliefs, goals and the queue of intentions. Part of agent.c. */

/* Ground terms */
typedef struct {
    int functor, n, args[MAXARGS];
    char *text;
} Term;
static Term *gw_terms;
static int gw_nterms, gw_room;

/* Terms and intentions are found by their hashes; a slot holds a number and 1 more. More slots than numbers. */
#define SLOTS 65536
static int gw_term_at[SLOTS], gw_its_at[SLOTS];
static unsigned gw_hash(const void *data, size_t size, unsigned hash) {
    const unsigned char *c = data;
    while (size--) hash = (hash ^ *c++) * 16777619u;
    return hash;
}
static void gw_unbound(short *b) {
    int i;
    for (i = 0; i < MAXVARS; i++) b[i] = -1;
}

static char *gw_text_of(int functor, int n, const int *args) {
    size_t size = strlen(names[functor]) + 3;
    int i;
    for (i = 0; i < n; i++) size += strlen(gw_terms[args[i]].text) + 1;
    char *text = malloc(size);
    strcpy(text, names[functor]);
    if (n) {
        strcat(text, "(");
        for (i = 0; i < n; i++) {
            if (i) strcat(text, ",");
            strcat(text, gw_terms[args[i]].text);
        }
        strcat(text, ")");
    }
    return text;
}
static int gw_term(int functor, int n, const int *args) {
    unsigned at = gw_hash(args, n * sizeof(int), gw_hash(&functor, sizeof functor, 2166136261u)) % SLOTS;
    const Term *known;
    for (; gw_term_at[at]; at = (at + 1) % SLOTS) {
        known = &gw_terms[gw_term_at[at] - 1];
        if (known->functor == functor && known->n == n && !memcmp(known->args, args, n * sizeof(int)))
            return gw_term_at[at] - 1;
    }
    if (gw_nterms == MAXTERMS) gw_give_up("too many terms");
    if (gw_nterms == gw_room) {
        gw_room = gw_room ? 2 * gw_room : 256;
        gw_terms = realloc(gw_terms, gw_room * sizeof(Term));
    }
    Term t;
    memset(&t, 0, sizeof t);
    t.functor = functor;
    t.n = n;
    memcpy(t.args, args, n * sizeof(int));
    t.text = gw_text_of(functor, n, args);
    gw_terms[gw_nterms] = t;
    gw_term_at[at] = gw_nterms + 1;
    return gw_nterms++;
}
/* Patterns: a variable has functor -1 and its number in args[0] */
static int gw_ground(int p, const short *b) {
    int i, args[MAXARGS];
    if (pats[p].functor < 0) return b[pats[p].args[0]];
    for (i = 0; i < pats[p].n; i++)
        if ((args[i] = gw_ground(pats[p].args[i], b)) < 0) return -1;
    return gw_term(pats[p].functor, pats[p].n, args);
}
static int gw_match(int p, int t, short *b) {
    int i;
    if (pats[p].functor < 0) {
        int v = pats[p].args[0];
        if (b[v] < 0) {
            b[v] = t;
            return 1;
        }
        return b[v] == t;
    }
    if (pats[p].functor != gw_terms[t].functor || pats[p].n != gw_terms[t].n) return 0;
    for (i = 0; i < pats[p].n; i++)
        if (!gw_match(pats[p].args[i], gw_terms[t].args[i], b)) return 0;
    return 1;
}

/* Intentions */
enum { STARTS = -2, PERCEIVES = -3, OPEN = -1 };
typedef struct {
    short event, drop, isgoal, kind, plan, at, null, fresh, b[MAXVARS];
} Frame;
typedef struct {
    short n, waiting, locked;
    Frame f[MAXFRAMES];
} Intention;
static Intention *gw_its;
static int gw_nits, gw_itroom;
static int gw_intention(Intention *x) {
    unsigned at;
    if (!x->n) memset(x, 0, sizeof *x);
    memset(&x->f[x->n], 0, (MAXFRAMES - x->n) * sizeof(Frame));
    at = gw_hash(x, (char *)&x->f[x->n] - (char *)x, 2166136261u) % SLOTS;
    for (; gw_its_at[at]; at = (at + 1) % SLOTS)
        if (!memcmp(&gw_its[gw_its_at[at] - 1], x, sizeof *x)) return gw_its_at[at] - 1;
    if (gw_nits == 32000) gw_give_up("too many intentions");
    if (gw_nits == gw_itroom) {
        gw_itroom = gw_itroom ? 2 * gw_itroom : 256;
        gw_its = realloc(gw_its, gw_itroom * sizeof *gw_its);
    }
    gw_its[gw_nits] = *x;
    gw_its_at[at] = gw_nits + 1;
    return gw_nits++;
}
static Frame fresh_frame(int event, int drop, int isgoal, int kind, int plan) {
    Frame f;
    memset(&f, 0, sizeof f);
    f.event = event;
    f.drop = drop;
    f.isgoal = isgoal;
    f.kind = kind;
    f.plan = plan;
    gw_unbound(f.b);
    return f;
}
static int gw_single(int event, int drop, int isgoal, int kind, int plan) {
    Intention x;
    memset(&x, 0, sizeof x);
    x.n = 1;
    x.f[0] = fresh_frame(event, drop, isgoal, kind, plan);
    return gw_intention(&x);
}
static int gw_left(const Frame *f) {
    if (f->plan == OPEN) return -1;
    if (f->plan < 0) return f->at ? f->null : 1;
    return plans[f->plan].n - f->at + f->null;
}

/* Mind */
static int gw_before(int t, int u) { return strcmp(gw_terms[t].text, gw_terms[u].text) < 0; }
static int gw_has(const S *s, int t) {
    int i;
    for (i = 0; i < s->nb; i++)
        if (s->bel[i] == t) return 1;
    return 0;
}
static void gw_add(S *s, int t, int seen) {
    int i;
    if (gw_has(s, t)) return;
    if (s->nb == MAXBEL) gw_give_up("too many beliefs");
    for (i = s->nb++; i && gw_before(t, s->bel[i - 1]); i--) {
        s->bel[i] = s->bel[i - 1];
        s->seen[i] = s->seen[i - 1];
    }
    s->bel[i] = t;
    s->seen[i] = seen;
}
static void gw_rid(S *s, int at) {
    int i;
    for (i = at; i + 1 < s->nb; i++) {
        s->bel[i] = s->bel[i + 1];
        s->seen[i] = s->seen[i + 1];
    }
    s->nb--;
    s->bel[s->nb] = 0;
    s->seen[s->nb] = 0;
}
static int gw_wants(const S *s, int t, int kind) {
    int i;
    for (i = 0; i < s->ng; i++)
        if (s->goal[i] == 2 * t + kind) return i;
    return -1;
}
static void gw_want(S *s, int t, int kind) {
    int i, g = 2 * t + kind;
    if (gw_wants(s, t, kind) >= 0) return;
    if (s->ng == MAXGOALS) gw_give_up("too many goals");
    for (i = s->ng++; i && (gw_before(t, s->goal[i - 1] / 2) || (t == s->goal[i - 1] / 2 && g < s->goal[i - 1])); i--)
        s->goal[i] = s->goal[i - 1];
    s->goal[i] = g;
}
static void gw_unwant(S *s, int t, int kind) {
    int i = gw_wants(s, t, kind);
    if (i < 0) return;
    for (; i + 1 < s->ng; i++) s->goal[i] = s->goal[i + 1];
    s->goal[--s->ng] = 0;
}
static int gw_holds(const S *s, const Cond *c, int n, short *b, int depth);
/* The first way to believe p such that the other conditions hold: bindings stay in b. */
static int gw_believes(const S *s, int p, short *b, int depth, const Cond *more, int n) {
    short old[MAXVARS];
    int i, g;
    memcpy(old, b, sizeof old);
    for (i = 0; i < s->nb; i++) {
        if (gw_match(p, s->bel[i], b) && gw_holds(s, more, n, b, depth)) return 1;
        memcpy(b, old, sizeof old);
    }
    if (depth > 60) gw_give_up("rules without end");
    for (i = 0; i < NRULES; i++) {
        short own[MAXVARS];
        gw_unbound(own);
        g = gw_ground(rules[i].head, own);
        if (gw_match(p, g, b) && gw_holds(s, rules[i].body, rules[i].n, own, depth + 1) &&
            gw_holds(s, more, n, b, depth))
            return 1;
        memcpy(b, old, sizeof old);
    }
    return 0;
}
static int gw_holds(const S *s, const Cond *c, int n, short *b, int depth) {
    short old[MAXVARS];
    int i;
    if (!n) return 1;
    memcpy(old, b, sizeof old);
    if (c->isgoal) {
        int met = 0;
        for (i = 0; i < s->ng; i++) {
            if ((c->kind < 0 || s->goal[i] % 2 == c->kind) && gw_match(c->pat, s->goal[i] / 2, b)) {
                if (!c->positive) {
                    met = 1;
                    break;
                }
                if (gw_holds(s, c + 1, n - 1, b, depth)) return 1;
            }
            memcpy(b, old, sizeof old);
        }
        memcpy(b, old, sizeof old);
        return c->positive ? 0 : !met && gw_holds(s, c + 1, n - 1, b, depth);
    }
    if (c->positive) return gw_believes(s, c->pat, b, depth, c + 1, n - 1);
    i = gw_believes(s, c->pat, b, depth, 0, 0);
    memcpy(b, old, sizeof old);
    return !i && gw_holds(s, c + 1, n - 1, b, depth);
}

/* The queue */
static void gw_put(S *s, int it) {
    if (s->nq == MAXQUEUE) gw_give_up("too many intentions at once");
    s->q[s->nq++] = it;
}
static int gw_take(S *s, int at) {
    int i, it = s->q[at];
    for (i = at; i + 1 < s->nq; i++) s->q[i] = s->q[i + 1];
    s->q[--s->nq] = 0;
    return it;
}
static void gw_sift(S *s) { /* those that can go on, then those that wait */
    short q[MAXQUEUE];
    int i, k = 0;
    for (i = 0; i < s->nq; i++)
        if (!gw_its[s->q[i]].waiting) q[k++] = s->q[i];
    for (i = 0; i < s->nq; i++)
        if (gw_its[s->q[i]].waiting) q[k++] = s->q[i];
    memcpy(s->q, q, s->nq * sizeof(short));
}
static int gw_ready(const S *s) {
    int i;
    for (i = 0; i < s->nq; i++)
        if (!gw_its[s->q[i]].waiting) return 1;
    return 0;
}
static void gw_wake(S *s, int t) { /* those that waited for what has changed */
    int i;
    for (i = 0; i < s->nq; i++) {
        Intention x = gw_its[s->q[i]];
        short b[MAXVARS];
        Frame *f = &x.f[x.n - 1];
        if (!x.waiting) continue;
        memcpy(b, f->b, sizeof b);
        if (gw_match(plans[f->plan].deeds[f->at].pat, t, b)) {
            x.waiting = 0;
            s->q[i] = gw_intention(&x);
        }
    }
}
/* Without its next deed; a goal whose frame goes leaves the goal base */
static void gw_tail(S *s, Intention *x) {
    Frame *f = &x->f[x->n - 1];
    if (f->null)
        f->null = 0;
    else
        f->at++;
    f->fresh = 0;
    if (gw_left(f) > 0) return;
    if (f->isgoal) gw_unwant(s, f->event, f->kind);
    x->n--;
}
static int gw_rows(const Intention *x) {
    int i, n = 0;
    for (i = 0; i < x->n; i++) n += gw_left(&x->f[i]) > 1 && !x->f[i].fresh ? 2 : 1;
    return n;
}
/* The order of u followed by x, and v followed by y */
static int gw_order(const char *u, const char *x, const char *v, const char *y) {
    for (;; u++, v++) {
        if (!*u && x) u = x, x = 0;
        if (!*v && y) v = y, y = 0;
        if (*u != *v || !*u) return (unsigned char)*u - (unsigned char)*v;
    }
}
static int gw_lighter(int a, int b) {
    static const char *const kinds[] = {" [perform]", " [achieve]"};
    const Intention *x = &gw_its[a], *y = &gw_its[b];
    const Frame *f = &x->f[x->n - 1], *g = &y->f[y->n - 1];
    if (gw_rows(x) != gw_rows(y)) return gw_rows(x) < gw_rows(y);
    if (f->drop != g->drop) return g->drop;       /* + before - */
    if (f->isgoal != g->isgoal) return f->isgoal; /* ! before the first character of any term */
    return gw_order(gw_terms[f->event].text, f->isgoal ? kinds[f->kind] : "", gw_terms[g->event].text,
                    g->isgoal ? kinds[g->kind] : "") < 0;
}
