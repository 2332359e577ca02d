/* A Gwendolen agent as Spin runs it: AIL's reasoning cycle over the program's own tables (agent.h), written apart from
   Avow's interpreter so that the two can be held against each other. Ground terms, intentions: interned, so that a state
   is a few numbers. What it cannot run makes it give up, and then there is no opinion. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static void gw_give_up(const char *why) { printf("gave up: %s\n", why); fflush(stdout); _exit(3); }

/* Ground terms */
typedef struct { int functor, n, args[MAXARGS]; char *text; } Term;
static Term *gw_terms; static int gw_nterms, gw_room;

static char *gw_text_of(int functor, int n, const int *args) {
  size_t size = strlen(names[functor]) + 3; int i;
  for (i = 0; i < n; i++) size += strlen(gw_terms[args[i]].text) + 1;
  char *text = malloc(size); strcpy(text, names[functor]);
  if (n) { strcat(text, "("); for (i = 0; i < n; i++) { if (i) strcat(text, ","); strcat(text, gw_terms[args[i]].text); } strcat(text, ")"); }
  return text;
}
static int gw_term(int functor, int n, const int *args) {
  int i;
  for (i = 0; i < gw_nterms; i++)
    if (gw_terms[i].functor == functor && gw_terms[i].n == n && !memcmp(gw_terms[i].args, args, n * sizeof(int))) return i;
  if (gw_nterms == MAXTERMS) gw_give_up("too many terms");
  if (gw_nterms == gw_room) { gw_room = gw_room ? 2 * gw_room : 256; gw_terms = realloc(gw_terms, gw_room * sizeof(Term)); }
  Term t; memset(&t, 0, sizeof t); t.functor = functor; t.n = n; memcpy(t.args, args, n * sizeof(int));
  t.text = gw_text_of(functor, n, args); gw_terms[gw_nterms] = t;
  return gw_nterms++;
}
/* Patterns: a variable has functor -1 and its number in args[0] */
static int gw_ground(int p, const short *b) {
  int i, args[MAXARGS];
  if (pats[p].functor < 0) return b[pats[p].args[0]];
  for (i = 0; i < pats[p].n; i++) if ((args[i] = gw_ground(pats[p].args[i], b)) < 0) return -1;
  return gw_term(pats[p].functor, pats[p].n, args);
}
static int gw_match(int p, int t, short *b) {
  int i;
  if (pats[p].functor < 0) { int v = pats[p].args[0]; if (b[v] < 0) { b[v] = t; return 1; } return b[v] == t; }
  if (pats[p].functor != gw_terms[t].functor || pats[p].n != gw_terms[t].n) return 0;
  for (i = 0; i < pats[p].n; i++) if (!gw_match(pats[p].args[i], gw_terms[t].args[i], b)) return 0;
  return 1;
}

/* Intentions */
enum { STARTS = -2, PERCEIVES = -3, OPEN = -1 };
typedef struct { short event, drop, isgoal, kind, plan, at, null, fresh, b[MAXVARS]; } Frame;
typedef struct { short n, waiting, locked; Frame f[MAXFRAMES]; } Intention;
static Intention *gw_its; static int gw_nits, gw_itroom;
static int gw_intention(Intention *x) {
  int i;
  if (!x->n) { memset(x, 0, sizeof *x); }
  for (i = x->n; i < MAXFRAMES; i++) memset(&x->f[i], 0, sizeof(Frame));
  for (i = 0; i < gw_nits; i++) if (!memcmp(&gw_its[i], x, sizeof *x)) return i;
  if (gw_nits == 32000) gw_give_up("too many intentions");
  if (gw_nits == gw_itroom) { gw_itroom = gw_itroom ? 2 * gw_itroom : 256; gw_its = realloc(gw_its, gw_itroom * sizeof *gw_its); }
  gw_its[gw_nits] = *x; return gw_nits++;
}
static Frame fresh_frame(int event, int drop, int isgoal, int kind, int plan) {
  Frame f; int i; memset(&f, 0, sizeof f);
  f.event = event; f.drop = drop; f.isgoal = isgoal; f.kind = kind; f.plan = plan;
  for (i = 0; i < MAXVARS; i++) f.b[i] = -1;
  return f;
}
static int gw_single(int event, int drop, int isgoal, int kind, int plan) {
  Intention x; memset(&x, 0, sizeof x); x.n = 1; x.f[0] = fresh_frame(event, drop, isgoal, kind, plan);
  return gw_intention(&x);
}
static int gw_left(const Frame *f) {
  if (f->plan == OPEN) return -1;
  if (f->plan < 0) return f->at ? f->null : 1;
  return plans[f->plan].n - f->at + f->null;
}

/* Mind */
static int gw_before(int t, int u) { return strcmp(gw_terms[t].text, gw_terms[u].text) < 0; }
static int gw_has(const S *s, int t) { int i; for (i = 0; i < s->nb; i++) if (s->bel[i] == t) return 1; return 0; }
static void gw_add(S *s, int t, int seen) {
  int i;
  if (gw_has(s, t)) return;
  if (s->nb == MAXBEL) gw_give_up("too many beliefs");
  for (i = s->nb++; i && gw_before(t, s->bel[i - 1]); i--) { s->bel[i] = s->bel[i - 1]; s->seen[i] = s->seen[i - 1]; }
  s->bel[i] = t; s->seen[i] = seen;
}
static void gw_rid(S *s, int at) {
  int i;
  for (i = at; i + 1 < s->nb; i++) { s->bel[i] = s->bel[i + 1]; s->seen[i] = s->seen[i + 1]; }
  s->nb--; s->bel[s->nb] = 0; s->seen[s->nb] = 0;
}
static int gw_wants(const S *s, int t, int kind) { int i; for (i = 0; i < s->ng; i++) if (s->goal[i] == 2 * t + kind) return i; return -1; }
static void gw_want(S *s, int t, int kind) {
  int i, g = 2 * t + kind;
  if (gw_wants(s, t, kind) >= 0) return;
  if (s->ng == MAXGOALS) gw_give_up("too many goals");
  for (i = s->ng++; i && (gw_before(t, s->goal[i - 1] / 2) || (t == s->goal[i - 1] / 2 && g < s->goal[i - 1])); i--) s->goal[i] = s->goal[i - 1];
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
  short old[MAXVARS]; int i, g;
  memcpy(old, b, sizeof old);
  for (i = 0; i < s->nb; i++) {
    if (gw_match(p, s->bel[i], b) && gw_holds(s, more, n, b, depth)) return 1;
    memcpy(b, old, sizeof old);
  }
  if (depth > 60) gw_give_up("rules without end");
  for (i = 0; i < NRULES; i++) {
    short none[MAXVARS]; int k, body = 1; short all[MAXVARS];
    for (k = 0; k < MAXVARS; k++) none[k] = all[k] = -1;
    g = gw_ground(rules[i].head, none);
    if (gw_match(p, g, b)) {
      body = gw_holds(s, rules[i].body, rules[i].n, all, depth + 1);
      if (body && gw_holds(s, more, n, b, depth)) return 1;
    }
    memcpy(b, old, sizeof old);
  }
  return 0;
}
static int gw_holds(const S *s, const Cond *c, int n, short *b, int depth) {
  short old[MAXVARS]; int i;
  if (!n) return 1;
  memcpy(old, b, sizeof old);
  if (c->isgoal) {
    int met = 0;
    for (i = 0; i < s->ng; i++) {
      if ((c->kind < 0 || s->goal[i] % 2 == c->kind) && gw_match(c->pat, s->goal[i] / 2, b)) {
        if (!c->positive) { met = 1; break; }
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
static void gw_put(S *s, int it) { if (s->nq == MAXQUEUE) gw_give_up("too many intentions at once"); s->q[s->nq++] = it; }
static int gw_take(S *s, int at) {
  int i, it = s->q[at];
  for (i = at; i + 1 < s->nq; i++) s->q[i] = s->q[i + 1];
  s->q[--s->nq] = 0;
  return it;
}
static void gw_sift(S *s) { /* those that can go on, then those that wait */
  short q[MAXQUEUE]; int i, k = 0;
  for (i = 0; i < s->nq; i++) if (!gw_its[s->q[i]].waiting) q[k++] = s->q[i];
  for (i = 0; i < s->nq; i++) if (gw_its[s->q[i]].waiting) q[k++] = s->q[i];
  memcpy(s->q, q, s->nq * sizeof(short));
}
static int gw_ready(const S *s) { int i; for (i = 0; i < s->nq; i++) if (!gw_its[s->q[i]].waiting) return 1; return 0; }
static void gw_wake(S *s, int p, int t) { /* p: the pattern of the deed, or -1; t: what has changed */
  int i;
  for (i = 0; i < s->nq; i++) {
    Intention x = gw_its[s->q[i]]; short b[MAXVARS]; Frame *f = &x.f[x.n - 1];
    if (!x.waiting) continue;
    memcpy(b, f->b, sizeof b);
    if (gw_match(plans[f->plan].deeds[f->at].pat, t, b)) { x.waiting = 0; s->q[i] = gw_intention(&x); }
  }
}
/* Without its next deed; a goal whose frame goes leaves the goal base */
static void gw_tail(S *s, Intention *x) {
  Frame *f = &x->f[x->n - 1];
  if (f->null) f->null = 0; else f->at++;
  f->fresh = 0;
  if (gw_left(f) > 0) return;
  if (f->isgoal) gw_unwant(s, f->event, f->kind);
  x->n--;
}
static int gw_rows(const Intention *x) { int i, n = 0; for (i = 0; i < x->n; i++) n += gw_left(&x->f[i]) > 1 && !x->f[i].fresh ? 2 : 1; return n; }
static int gw_lighter(int a, int b) {
  const Intention *x = &gw_its[a], *y = &gw_its[b]; const Frame *f = &x->f[x->n - 1], *g = &y->f[y->n - 1];
  char u[4096], v[4096];
  if (gw_rows(x) != gw_rows(y)) return gw_rows(x) < gw_rows(y);
  snprintf(u, sizeof u, "%s%s%s%s", f->drop ? "-" : "+", f->isgoal ? "!" : "", gw_terms[f->event].text, f->isgoal ? f->kind ? " [achieve]" : " [perform]" : "");
  snprintf(v, sizeof v, "%s%s%s%s", g->drop ? "-" : "+", g->isgoal ? "!" : "", gw_terms[g->event].text, g->isgoal ? g->kind ? " [achieve]" : " [perform]" : "");
  return strcmp(u, v) < 0;
}

/* The environment */
static int gw_offered(const short *now, int *found) {
  int g, i, k, n = 0, all[NGROUPS + 1];
  for (g = 0; g < NGROUPS; g++) {
    int t = now[g] < 0 ? -1 : percepts[g][now[g]];
    if (t < 0) continue;
    short none[MAXVARS]; for (i = 0; i < MAXVARS; i++) none[i] = -1;
    t = gw_ground(t, none);
    for (i = 0; i < n && all[i] != t; i++);
    if (i < n) continue;
    for (k = n++; k && gw_before(t, all[k - 1]); k--) all[k] = all[k - 1];
    all[k] = t;
  }
  memcpy(found, all, n * sizeof(int));
  return n;
}
static int gw_narrowing(int functor) { int i; for (i = 1; i <= NAFTER; i++) if (after[i] == functor) return i; return NAFTER + 1; }
static int gw_count(int row) { int g, n = 1; for (g = 0; g < NGROUPS; g++) n *= options[row][g][0]; return n; }
static void gw_draw(S *s, int row, int way) {
  int g;
  for (g = NGROUPS - 1; g >= 0; g--) {
    int n = options[row][g][0], at = options[row][g][1 + way % n];
    way /= n;
    if (at >= 0) s->now[g] = at;
  }
}

/* One cycle's first half */
static void gw_choose(S *s) {
  Intention x = gw_its[s->cur]; Frame *f = &x.f[x.n - 1]; int i, k;
  if (f->plan != OPEN) { s->planned = 1; return; }
  for (i = 0; i < NPLANS; i++) {
    short b[MAXVARS];
    if (plans[i].drop != f->drop || plans[i].isgoal != f->isgoal || (f->isgoal && plans[i].kind >= 0 && plans[i].kind != f->kind)) continue;
    for (k = 0; k < MAXVARS; k++) b[k] = -1;
    if (!gw_match(plans[i].trigger, f->event, b) || !gw_holds(s, plans[i].guard, plans[i].nguard, b, 0)) continue;
    if (!plans[i].n) {
      if (f->isgoal && !f->drop) gw_unwant(s, f->event, f->kind);
      x.n--;
      s->cur = gw_intention(&x); s->planned = x.n > 0;
      return;
    }
    f->plan = i; f->fresh = 1; memcpy(f->b, b, sizeof b);
    s->cur = gw_intention(&x); s->planned = 1;
    return;
  }
  if (f->isgoal && !f->drop) {
    if (x.n == MAXFRAMES) gw_give_up("too many goals on goals");
    x.f[x.n] = *f; x.f[x.n].drop = 1; x.n++;
    s->cur = gw_intention(&x); s->planned = 1;
  } else if (f->isgoal) s->planned = 1;
  else { x.n = 0; s->cur = gw_intention(&x); s->planned = 0; }
}
static void gw_cycle(S *s, int again) {
  int i, k, n, t[NGROUPS + 1], nothing;
  s->planned = 0; s->asleep = 0;
  if (s->fresh) {
    short gone[MAXBEL]; int ngone = 0;
    for (i = 0; i < s->nb; i++) if (s->seen[i]) {
      char u[4096], v[4096];
      for (k = ngone++; k; k--) {
        snprintf(u, sizeof u, "%s[", gw_terms[s->bel[i]].text); snprintf(v, sizeof v, "%s[", gw_terms[gone[k - 1]].text);
        if (strcmp(u, v) >= 0) break;
        gone[k] = gone[k - 1];
      }
      gone[k] = s->bel[i];
    }
    n = gw_offered(s->now, t);
    for (i = 0; i < ngone + n; i++) {
      int it = i < ngone ? gw_single(gone[i], 1, 0, 0, PERCEIVES) : gw_single(t[i - ngone], 0, 0, 0, PERCEIVES);
      for (k = 0; k < s->nq && s->q[k] != it; k++);
      if (k == s->nq) gw_put(s, it);
    }
  }
  s->fresh = again;
  nothing = s->cur < 0 || !gw_its[s->cur].n;
  gw_sift(s);
  if (nothing || (gw_its[s->cur].waiting && !gw_its[s->cur].locked)) {
    int old = nothing ? -1 : s->cur;
    if (!gw_ready(s)) { if (old >= 0) gw_put(s, old); s->cur = -1; s->asleep = 1; return; }
    s->cur = gw_take(s, 0);
    if (old >= 0) gw_put(s, old);
  } else if (!gw_its[s->cur].locked) {
    for (k = 0; k < s->nq && !gw_its[s->q[k]].waiting; k++);
    gw_put(s, 0);
    for (i = s->nq - 1; i > k; i--) s->q[i] = s->q[i - 1];
    s->q[k] = s->cur;
    s->cur = gw_take(s, 0);
  }
  gw_choose(s);
}

/* The second half: one deed */
static int gw_fits(const Frame *f, int t) { return f->isgoal && f->event == t; }
static int gw_deed(S *s, int way) { /* the ways that there are; does it if way >= 0 */
  Intention x = gw_its[s->cur]; Frame *f = &x.f[x.n - 1]; const Deed *d = 0; int i, k, t, kind, dynamic = f->plan < 0;
  if (f->plan == OPEN) { if (way >= 0) { s->planned = 0; } return 1; }
  if (f->null) { if (way >= 0) { gw_tail(s, &x); s->cur = gw_intention(&x); s->planned = 0; } return 1; }
  if (!dynamic) d = &plans[f->plan].deeds[f->at];
  kind = f->plan == STARTS ? ADDGOAL : f->plan == PERCEIVES ? f->drop ? DROPBEL : ADDBEL : d->what;
  t = dynamic ? f->event : d->pat < 0 ? -1 : gw_ground(d->pat, f->b);
  if (kind == ACT) {
    int silent = pats[d->pat].functor == PRINT, row;
    if (t < 0 && !silent) gw_give_up("an action with a free variable");
    row = gw_narrowing(pats[d->pat].functor);
    for (k = 0; k < NQUIET && quiet[k] != pats[d->pat].functor; k++);
    if (silent || k < NQUIET) row = 0;
    if (way < 0) return row ? gw_count(row) : 1;
    gw_tail(s, &x); s->cur = gw_intention(&x); s->planned = 0; s->waited = 0;
    if (!silent) s->last = t;
    if (row) {
      int found[NGROUPS + 1], had = gw_offered(s->now, found) > 0;
      gw_draw(s, row, way);
      s->fresh = s->fresh || had || gw_offered(s->now, found) > 0;
    }
    return 1;
  }
  if (way < 0) return 1;
  s->planned = 0;
  switch (kind) {
    case ADDBEL: {
      short b[MAXVARS]; int known;
      if (t < 0) gw_give_up("a belief with a free variable");
      for (i = 0; i < MAXVARS; i++) b[i] = -1;
      known = gw_has(s, t);
      for (i = 0; i < NRULES && !known; i++) if (gw_ground(rules[i].head, b) == t) { short c[MAXVARS]; memcpy(c, b, sizeof c); known = gw_holds(s, rules[i].body, rules[i].n, c, 1); }
      gw_add(s, t, x.f[0].plan == PERCEIVES);
      gw_tail(s, &x); s->cur = gw_intention(&x); gw_wake(s, -1, t);
      if (!known) gw_put(s, gw_single(t, 0, 0, 0, OPEN));
      return 1; }
    case DROPBEL: {
      int gone = 0, lost[MAXBEL]; short b[MAXVARS], first[MAXVARS];
      for (i = 0; i < s->nb;) {
        memcpy(b, f->b, sizeof b);
        if (t >= 0 ? s->bel[i] == t : gw_match(d->pat, s->bel[i], b)) { if (!gone) memcpy(first, b, sizeof b); lost[gone++] = s->bel[i]; gw_rid(s, i); } else i++;
      }
      if (t < 0 && gone) { /* the event keeps the variable: it may be another only if no plan asks for it */
        for (i = 0; i < NPLANS; i++)
          if (plans[i].drop && !plans[i].isgoal && pats[plans[i].trigger].functor == pats[d->pat].functor) gw_give_up("a plan for a dropped belief with a free variable");
        memcpy(f->b, first, sizeof first);
      }
      gw_tail(s, &x); s->cur = gw_intention(&x);
      if (t >= 0) gw_wake(s, -1, t); else for (i = 0; i < s->nq; i++) if (gw_its[s->q[i]].waiting) gw_give_up("waiting for a belief with a free variable");
      for (i = 0; i < gone; i++) gw_put(s, gw_single(lost[i], 1, 0, 0, OPEN));
      return 1; }
    case LOCKS: case UNLOCKS: x.locked = kind == LOCKS; gw_tail(s, &x); s->cur = gw_intention(&x); return 1;
    case WAITS: case WAITSNOT: {
      short b[MAXVARS]; int met;
      memcpy(b, f->b, sizeof b);
      met = gw_believes(s, d->pat, b, 0, 0, 0);
      if (kind == WAITS ? met : !met) { if (kind == WAITS) memcpy(f->b, b, sizeof b); gw_tail(s, &x); s->cur = gw_intention(&x); return 1; }
      x.waiting = 1; s->cur = gw_intention(&x);
      if (!gw_ready(s)) { gw_put(s, s->cur); x.n = 0; s->cur = gw_intention(&x); s->asleep = 1; }
      gw_sift(s);
      for (k = 0; k < s->nq && !gw_its[s->q[k]].waiting; k++);
      for (i = k + 1; i < s->nq; i++) { int j, it = s->q[i]; for (j = i; j > k && gw_lighter(it, s->q[j - 1]); j--) s->q[j] = s->q[j - 1]; s->q[j] = it; }
      return 1; }
    case ADDGOAL: {
      int gk = dynamic ? f->kind : d->kind; short b[MAXVARS];
      memcpy(b, f->b, sizeof b);
      if (gk) {
        int met = dynamic ? gw_has(s, t) : gw_believes(s, d->pat, b, 0, 0, 0), elsewhere = 0;
        if (dynamic && !met) { short none[MAXVARS]; for (i = 0; i < MAXVARS; i++) none[i] = -1;
          for (i = 0; i < NRULES && !met; i++) if (gw_ground(rules[i].head, none) == t) { short c[MAXVARS]; memcpy(c, none, sizeof c); met = gw_holds(s, rules[i].body, rules[i].n, c, 1); } }
        if (met) {
          if (t < 0) gw_give_up("an achieved goal with a free variable");
          for (i = 0; i < s->nq; i++) for (k = 0; k < gw_its[s->q[i]].n; k++) elsewhere |= gw_fits(&gw_its[s->q[i]].f[k], t);
          memcpy(f->b, b, sizeof b); gw_tail(s, &x); s->cur = gw_intention(&x);
          if (!elsewhere) gw_unwant(s, t, 1);
          return 1;
        }
      }
      if (t < 0) gw_give_up("a goal with a free variable");
      if (gk && gw_wants(s, t, 1) >= 0) { gw_tail(s, &x); s->cur = gw_intention(&x); return 1; }
      gw_want(s, t, gk);
      if (x.n == MAXFRAMES) gw_give_up("too many goals on goals");
      f->fresh = 0;
      if (!gk) { f->at++; f->null = 1; }
      x.f[x.n++] = fresh_frame(t, 0, 1, gk, OPEN);
      s->cur = gw_intention(&x);
      return 1; }
    case DROPGOAL: {
      int gk = d->kind, exact = -1, loose = 0, j; Intention lost; memset(&lost, 0, sizeof lost);
      if (t < 0) gw_give_up("a dropped goal with a free variable");
      gw_unwant(s, t, gk);
      for (i = x.n - 1; i >= 0; i--) if (gw_fits(&x.f[i], t)) { loose = 1; if (!x.f[i].drop && x.f[i].kind == gk) exact = i; }
      if (loose) { lost = x; if (exact >= 0) x.n = exact; gw_tail(s, &x); }
      else {
        for (j = 0; j < s->nq;) {
          Intention y = gw_its[s->q[j]]; int e = -1, l = 0; Frame *g = &y.f[y.n - 1];
          for (i = y.n - 1; i >= 0; i--) if (gw_fits(&y.f[i], t)) { l = 1; if (!y.f[i].drop && y.f[i].kind == gk) e = i; }
          if (l) { lost = y; if (e >= 0) y.n = e; y.waiting = 0; gw_tail(s, &y); }
          else if (!gk && !g->null && ((g->plan == STARTS && !g->at && g->event == t) || (g->plan >= 0 && plans[g->plan].deeds[g->at].what == ADDGOAL && gw_ground(plans[g->plan].deeds[g->at].pat, g->b) == t))) gw_tail(s, &y);
          if (y.n) s->q[j++] = gw_intention(&y); else gw_take(s, j);
        }
        gw_tail(s, &x);
      }
      for (i = 0; i < lost.n; i++) if (lost.f[i].isgoal) gw_unwant(s, lost.f[i].event, lost.f[i].kind);
      s->cur = gw_intention(&x);
      return 1; }
  }
  gw_give_up("a deed that is not known");
  return 0;
}

/* The state graph */
static void gw_begin(S *s) {
  int i; short none[MAXVARS]; Intention x; memset(&x, 0, sizeof x); memset(s, 0, sizeof *s); s->up = 1;
  for (i = 0; i < MAXVARS; i++) none[i] = -1;
  for (i = 0; i < NBELIEFS; i++) gw_add(s, gw_ground(beliefs[i], none), 0);
  for (i = 0; i < NGROUPS; i++) s->now[i] = -1;
  s->cur = gw_intention(&x); s->last = -1; s->fresh = 1; s->begun = !AT_START;
  for (i = 0; i < NGOALS; i++) {
    int it = gw_single(gw_ground(goals[i][0], none), 0, 1, goals[i][1], STARTS);
    Intention y = gw_its[it]; y.f[0].isgoal = 0; y.f[0].kind = goals[i][1]; it = gw_intention(&y);
    if (i) gw_put(s, it); else s->cur = it;
  }
}
static int gw_step(S *s, int way) {
  int found[NGROUPS + 1];
  if (s->over) return 1;
  if (s->planned) return gw_deed(s, way);
  if (s->asleep) {
    int had, now;
    if (QUIESCENCE == 0 || s->waited) { if (way >= 0) s->over = 1; return 1; }
    if (way < 0) return gw_count(NAFTER + 1);
    had = gw_offered(s->now, found) > 0;
    gw_draw(s, NAFTER + 1, way);
    now = gw_offered(s->now, found) > 0;
    s->fresh = s->fresh || had || now; s->waited = QUIESCENCE == 1;
    gw_cycle(s, 0);
    if (!now && QUIESCENCE == 1) s->over = 1;
    return 1;
  }
  if (!s->begun) {
    if (way < 0) return gw_count(NAFTER + 2);
    gw_draw(s, NAFTER + 2, way); s->begun = 1; gw_cycle(s, !PROBED);
    return 1;
  }
  if (way >= 0) gw_cycle(s, 0);
  return 1;
}
static int says(const S *s, int atom) {
  short b[MAXVARS]; int i, found[NGROUPS + 1], n; S first;
  if (!s->up) { gw_begin(&first); s = &first; }
  for (i = 0; i < MAXVARS; i++) b[i] = -1;
  switch (atoms[atom].what) {
    case 'B': return gw_believes(s, atoms[atom].pat, b, 0, 0, 0);
    case 'D': return s->last >= 0 && gw_match(atoms[atom].pat, s->last, b);
    case 'G': for (i = 0; i < s->ng; i++) { short c[MAXVARS]; memcpy(c, b, sizeof c); if (gw_match(atoms[atom].pat, s->goal[i] / 2, c)) return 1; } return 0;
    default:
      if (!s->fresh || !s->begun || s->over) return 0;
      n = gw_offered(s->now, found);
      for (i = 0; i < n; i++) { short c[MAXVARS]; memcpy(c, b, sizeof c); if (gw_match(atoms[atom].pat, found[i], c)) return 1; }
      return 0;
  }
}
static int ways(const S *s) { S copy = *s; return s->up ? gw_step(&copy, -1) : 1; }
static void go(S *s, int way) { if (s->up) gw_step(s, way); else gw_begin(s); }
