/* Gwendolen agents as Spin runs them: AIL's reasoning cycle and its scheduler over the programs' own tables (agent.h),
   written apart from Avow's interpreter so that the two can be held against each other. Terms, intentions and minds are
   interned, so that a state is a few numbers. What it cannot run makes it give up, and then there is no opinion.

   Every name here starts with gw_, except what Spin's model calls: ways, go, says. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "agent.h"

static void gw_give_up(const char *why) {
    printf("gave up: %s\n", why);
    fflush(stdout);
    _exit(3);
}

#include "agent_terms.c"
#include "agent_reason.c"
#include "agent_mind.c"
static int progname(const Agent *a) { return gw_atom(names[a->name]); }
#include "agent_deeds.c"

/* The environment: what is on offer, in the order of the texts */
static int gw_offered(const short *now, int *found) {
    int g, i, k, n = 0, none[MAXVARS];
    gw_unbound(none);
    for (g = 0; g < NGROUPS; g++) {
        int t = now[g] < 0 ? -1 : percepts[g][now[g]];
        if (t < 0) continue;
        t = gw_build(t, none);
        for (i = 0; i < n && found[i] != t; i++);
        if (i < n) continue;
        for (k = n++; k && gw_before(t, found[k - 1]); k--) found[k] = found[k - 1];
        found[k] = t;
    }
    return n;
}
static int gw_offers(const short *now) {
    int found[NGROUPS];
    return gw_offered(now, found);
}
static int gw_narrowing(int functor) {
    int i;
    for (i = 1; i <= NAFTER; i++)
        if (after[i] == functor) return i;
    return NAFTER + 1;
}
static int gw_count(int row) {
    int g, n = 1;
    for (g = 0; g < NGROUPS; g++) n *= options[row][g][0];
    return n;
}
static void gw_draw(S *s, int row, int way) {
    int g;
    for (g = NGROUPS - 1; g >= 0; g--) {
        int n = options[row][g][0], at = options[row][g][1 + way % n];
        way /= n;
        if (at >= 0) s->now[g] = at;
    }
    s->drawn = FAIR;
}

/* One cycle's first half: perceive, select an intention, choose a plan */
static void gw_choose(Mind *m) {
    Intention x;
    Frame *f;
    int i, event, ground;
    gw_load(&x, m->cur);
    f = &x.f[x.n - 1];
    m->planned = 1;
    if (f->plan != OPEN) return;
    event = gw_export(f->event, 0);
    ground = gw_shown[event].ground;
    for (i = m->of->first; i < m->of->last; i++) {
        const Plan *p = &plans[i];
        int env[MAXVARS], kind = ground && p->loose ? p->kind > 0 : f->kind;
        if (p->drop != f->drop || p->isgoal != f->isgoal) continue;
        if (f->isgoal && !(ground && p->loose) && p->kind >= 0 && p->kind != f->kind) continue;
        gw_unbound(env);
        if (!gw_unify(gw_build(p->trigger, env), f->event) || !gw_solve(m, p->guard, p->nguard, env, 0, 0)) {
            gw_undo(0);
            continue;
        }
        if (!p->n) {
            if (f->isgoal && !f->drop) gw_unwant(m, event, f->kind);
            x.n--;
            m->planned = x.n > 0;
        } else {
            if (f->isgoal) f->kind = kind; /* AIL goes on with the plan's kind */
            f->plan = i;
            f->fresh = 1;
            memcpy(f->env, env, sizeof env);
        }
        m->cur = gw_store(&x);
        return;
    }
    if (x.n == 1 && !(f->isgoal && f->drop)) {
        m->cur = NOBODY;
        m->planned = 0;
    } else if (f->isgoal && !f->drop) {
        gw_push(&x, f->event, 1, 1, f->kind, OPEN);
        m->cur = gw_store(&x);
    }
}
static int gw_unseen(const Mind *m, int *gone) { /* what was perceived; AIL sorts it with its annotations */
    int i, k, n = 0;
    char *a, *b;
    for (i = 0; i < m->nb; i++)
        if (m->seen[i]) {
            for (k = n++; k; k--) {
                a = gw_join(gw_shown[m->bel[i]].text, "[", "");
                b = gw_join(gw_shown[gone[k - 1]].text, "[", "");
                int less = gw_order(a, b) < 0;
                free(a);
                free(b);
                if (!less) break;
                gone[k] = gone[k - 1];
            }
            gone[k] = m->bel[i];
        }
    return n;
}
static void gw_perceive(Mind *m, const short *now) {
    int i, k, it, offered[NGROUPS], gone[MAXBEL], ngone = gw_unseen(m, gone), n = gw_offered(now, offered);
    if (!EDGE) {
        for (i = 0; i < ngone + n; i++) {
            it = i < ngone ? gw_single(gone[i], 1, 0, PERCEIVES) : gw_single(offered[i - ngone], 0, 0, PERCEIVES);
            for (k = 0; k < m->nq && m->q[k] != it; k++);
            if (k == m->nq) gw_put(m, it);
        }
        return;
    }
    int come[NGROUPS], ncome = 0, left = 0;
    for (i = 0; i < n; i++) { /* what persists is no event; what the agent believes of itself is */
        for (k = 0; k < ngone && gone[k] != offered[i]; k++);
        if (k == ngone) come[ncome++] = offered[i];
    }
    for (i = 0; i < ngone; i++) {
        for (k = 0; k < n && offered[k] != gone[i]; k++);
        if (k == n) gone[left++] = gone[i];
    }
    for (i = 0; i < left; i++) {
        for (k = 0; m->bel[k] != gone[i]; k++);
        gw_rid(m, k);
    }
    for (i = 0; i < ncome; i++) gw_add(m, come[i], 1);
    if (left + ncome) {
        gw_wake(m, 0);
        if (m->cur > NOBODY) m->cur = gw_woken(m, m->cur, 0);
    }
    for (i = 0; i < left; i++) gw_put(m, gw_single(gone[i], 1, 0, OPEN));
    for (i = 0; i < ncome; i++) gw_put(m, gw_single(come[i], 0, 0, OPEN));
}
static void gw_cycle(Mind *m, const short *now, const int *letters, int nletters, int again) {
    int i, old, ready;
    gw_top = gw_ntrail = 0;
    m->planned = m->asleep = 0;
    if (m->fresh) gw_perceive(m, now);
    for (i = 0; i < nletters; i++) gw_put(m, letters[i]);
    m->fresh = again;
    old = m->cur;
    if (old > NOBODY && gw_locks(old)) {
        gw_choose(m);
        return;
    }
    ready = gw_sift(m);
    if (old <= NOBODY || gw_waits(old)) {
        m->cur = ready ? gw_take(m, 0) : -1;
        m->asleep = !ready;
        if (old > NOBODY) gw_put(m, old);
        if (m->asleep) return;
    } else {
        gw_put(m, 0);
        for (i = m->nq - 1; i > ready; i--) m->q[i] = m->q[i - 1];
        m->q[ready] = old;
        m->cur = gw_take(m, 0);
    }
    gw_choose(m);
}

/* The half of a cycle that an agent's mind does next; where it does not look around, it is worked out once for a mind */
typedef struct {
    int known, mind, asleep;
    Told told;
} Half;
static Half *gw_halves;
static signed char *gw_held; /* for each mind and atom: whether it holds, and 1 more */
static int gw_halfroom;
static Pool gw_mail; /* what is yet to be read: intentions */
static int gw_planned(int mind) {
    int n;
    return gw_row(&gw_minds, mind, &n)[4];
}
static Half gw_half(const S *s, int a, int again) {
    int n, number = s->mind[a], old = gw_halfroom;
    const int *letters = gw_row(&gw_mail, s->mail[a], &n);
    Half done = {1, 0, 0, {-1, -1, -1}};
    Mind m;
    if (number >= gw_halfroom) {
        while (number >= gw_halfroom) gw_halfroom = gw_halfroom ? 2 * gw_halfroom : 1024;
        gw_halves = gw_grown(gw_halves, gw_halfroom * sizeof(Half));
        memset(gw_halves + old, 0, (gw_halfroom - old) * sizeof(Half));
    }
    gw_recall(&m, number, &agents[a]);
    if (gw_halves[number].known && (m.planned || !(m.fresh || n || again))) return gw_halves[number];
    int alone = m.planned || !(m.fresh || n || again);
    if (m.planned)
        done.told = gw_deed(&m);
    else
        gw_cycle(&m, s->now, letters, n, again);
    done.asleep = m.asleep;
    m.asleep = 0;
    done.mind = gw_keep(&m);
    if (alone) gw_halves[number] = done;
    return done;
}
static void gw_take_half(S *s, int a, const Half *done) {
    if (!gw_planned(s->mind[a])) s->mail[a] = 0;
    s->mind[a] = done->mind;
    if (NAGENTS == 1)
        s->awake[a] = !done->asleep;
    else if (done->asleep) {
        s->awake[a] = 0;
        s->changed = 1;
    }
}

/* The state graph */
static void gw_begin(S *s) {
    int i, a, none[MAXVARS];
    Mind m;
    memset(s, 0, sizeof *s);
    gw_name(0);
    gw_unbound(none);
    gw_top = gw_ntrail = 0;
    if (!gw_its.n) {
        Intention x;
        memset(&x, 0, sizeof x);
        gw_store(&x);
        gw_intern(&gw_mail, none, 0);
    }
    for (a = 0; a < NAGENTS; a++) {
        memset(&m, 0, sizeof m);
        m.of = &agents[a];
        for (i = 0; i < m.of->nbeliefs; i++) gw_add(&m, gw_build(m.of->beliefs[i], none), 0);
        m.fresh = 1;
        for (i = 0; i < m.of->ngoals; i++) {
            int it = gw_single(gw_build(m.of->goals[i][0], none), 0, m.of->goals[i][1], STARTS);
            if (i)
                gw_put(&m, it);
            else
                m.cur = it;
        }
        s->mind[a] = gw_keep(&m);
        s->awake[a] = 1;
    }
    for (i = 0; i < NGROUPS; i++) s->now[i] = -1;
    s->last = -1;
    s->up = 1;
    s->changed = NAGENTS > 1;
    s->begun = !AT_START;
    if (NAGENTS > 1 && PROBED && !s->begun && gw_count(NAFTER + 2) == 1) {
        gw_draw(s, NAFTER + 2, 0);
        s->begun = 1;
    }
}
/* A draw was made over what was there before: everybody looks again, if there was or is anything to see */
static void gw_look(S *s, int had) {
    int a, has = gw_offers(s->now);
    Mind m;
    for (a = 0; (had || has) && a < NAGENTS; a++) {
        gw_recall(&m, s->mind[a], &agents[a]);
        m.fresh = 1;
        s->mind[a] = gw_keep(&m);
    }
    if (!has || NAGENTS == 1) return;
    memset(s->awake, 1, NAGENTS);
    s->changed = 1;
}
static char *gw_letter(int it) { /* the text by which AIL sorts messages */
    Intention x;
    char *text;
    gw_load(&x, it);
    int t = gw_export(x.f[0].event, 0);
    const char *force = gw_shown[gw_arg(t, 2)].text;
    text = gw_join(gw_shown[gw_arg(t, 0)].text, ",",
                   !strcmp(force, "tell") ? "1," : !strcmp(force, "perform") ? "2," : "3,");
    return gw_longer(text, gw_shown[gw_arg(t, 3)].text, ")");
}
static void gw_deliver(S *s, const Told *told) {
    int a, i, n, less, row[MAXQUEUE];
    const int *old;
    char *text, *other;
    s->changed = 1;
    for (a = 0; a < NAGENTS && strcmp(names[agents[a].name], gw_shown[told->to].text); a++);
    if (a == NAGENTS) return;
    s->awake[a] = 1;
    old = gw_row(&gw_mail, s->mail[a], &n);
    for (i = 0; i < n; i++)
        if (old[i] == told->letter) return;
    if (n == MAXQUEUE) gw_give_up("too many messages");
    memcpy(row, old, n * sizeof(int));
    text = gw_letter(told->letter);
    for (i = n++; i; i--) {
        other = gw_letter(row[i - 1]);
        less = gw_order(text, other) < 0;
        free(other);
        if (!less) break;
        row[i] = row[i - 1];
    }
    free(text);
    row[i] = told->letter;
    s->mail[a] = gw_intern(&gw_mail, row, n);
}
/* The job of the agent whose turn it is. This and what follows: how many ways it has, if way < 0; else it takes one. */
static int gw_job(S *s, int way) {
    int a = s->turn, k, row, name, had;
    Half done;
    if (!s->begun && !gw_planned(s->mind[a])) {
        if (way < 0) return gw_count(NAFTER + 2);
        gw_draw(s, NAFTER + 2, way);
        s->begun = 1;
        done = gw_half(s, a, NAGENTS > 1 || !PROBED);
        gw_take_half(s, a, &done);
        if (NAGENTS > 1 && gw_offers(s->now)) s->changed = 1;
        return 1;
    }
    done = gw_half(s, a, 0);
    name = done.told.action < 0 ? PRINT : gw_functor(done.told.action);
    for (k = 0; k < NQUIET && quiet[k] != name; k++);
    row = name == PRINT || k < NQUIET ? 0 : gw_narrowing(name);
    if (way < 0) return row ? gw_count(row) : 1;
    gw_take_half(s, a, &done);
    if (done.told.action >= 0) s->waited = 0;
    if (name == PRINT) return 1;
    s->last = done.told.action;
    s->whose = a;
    if (row) {
        had = gw_offers(s->now) > 0;
        gw_draw(s, row, way);
        gw_look(s, had);
    }
    if (NAGENTS > 1 && done.told.to >= 0) gw_deliver(s, &done.told);
    return 1;
}
/* Nobody has anything to do: the environment moves on, or the run is over */
static int gw_idle(S *s, int way) {
    int had = gw_offers(s->now) > 0, a, n, ways = 0, up;
    S drawn;
    Half done;
    if (QUIESCENCE == 0 || s->waited) {
        if (way >= 0) s->over = 1;
        return 1;
    }
    for (n = 0; n < gw_count(NAFTER + 1); n++) {
        drawn = *s;
        gw_draw(&drawn, NAFTER + 1, n);
        drawn.waited = QUIESCENCE == 1;
        gw_look(&drawn, had);
        up = QUIESCENCE == 2 || gw_offers(drawn.now);
        if (QUIESCENCE == 2) memset(drawn.awake, 1, NAGENTS);
        for (a = up ? 0 : s->turn; a < (up ? NAGENTS : s->turn + 1); a++)
            if (ways++ == way) {
                *s = drawn;
                s->turn = a;
                if (up) s->changed = 0;
                done = gw_half(s, a, 0);
                gw_take_half(s, a, &done);
                s->over = !up;
                return 1;
            }
    }
    return ways;
}
static int gw_step(S *s, int way) {
    int a, n, ways = 0, up = 0;
    s->drawn = 0;
    if (s->over) return 1;
    if (NAGENTS > 1 && PROBED && !s->begun) {
        if (way < 0) return gw_count(NAFTER + 2);
        gw_draw(s, NAFTER + 2, way);
        s->begun = 1;
        return 1;
    }
    for (a = 0; a < NAGENTS; a++) up |= s->awake[a];
    if (!up) return gw_idle(s, way);
    for (a = 0; a < NAGENTS; a++) {
        S next = *s;
        if (s->changed ? !s->awake[a] : a != s->turn) continue;
        next.turn = a;
        next.changed = 0;
        n = gw_job(&next, -1);
        if (way >= ways && way < ways + n) {
            gw_job(&next, way - ways);
            *s = next;
            return 1;
        }
        ways += n;
    }
    return ways;
}
int ways(const S *s) { /* Spin asks for each way whether there is one */
    static S asked;
    static int found;
    S copy = *s;
    if (!s->up) return 1;
    if (!found || memcmp(&asked, s, sizeof copy)) {
        asked = copy;
        found = gw_step(&copy, -1);
    }
    return found;
}
void go(S *s, int way) {
    if (s->up)
        gw_step(s, way);
    else
        gw_begin(s);
}

/* What properties ask */
static int gw_intended(const Mind *m, int what, int p) {
    Intention x;
    int i, k, d, env[MAXVARS];
    for (i = -1; i < m->nq; i++) {
        if ((i < 0 ? m->cur : m->q[i]) <= NOBODY) continue;
        gw_load(&x, i < 0 ? m->cur : m->q[i]);
        for (k = 0; k < x.n; k++) {
            Frame *f = &x.f[k];
            gw_unbound(env);
            if (what == 'I' && f->isgoal && !f->drop && f->plan != OPEN && gw_unifies(gw_build(p, env), f->event))
                return 1;
            for (d = f->at; what == 'T' && f->plan >= 0 && d < plans[f->plan].n; d++)
                if (plans[f->plan].deeds[d].what == ACT &&
                    gw_unifies(gw_build(p, env), gw_build(plans[f->plan].deeds[d].pat, f->env)))
                    return 1;
        }
    }
    return 0;
}
static int gw_thinks(int mind, int atom) {
    const Said *said = &atoms[atom];
    int env[MAXVARS];
    Mind m;
    gw_top = gw_ntrail = 0;
    gw_unbound(env);
    gw_recall(&m, mind, &agents[said->agent]);
    switch (said->what) {
    case 'B': return gw_believes(&m, gw_build(said->pat, env), 0, 0);
    case 'G': return gw_wanted(&m, gw_build(said->pat, env), -1, 0);
    default: return gw_intended(&m, said->what, said->pat);
    }
}
int says(const S *s, int atom) {
    static int room;
    const Said *said = &atoms[atom];
    int i, n, found[NGROUPS], env[MAXVARS];
    S first;
    if (!s->up) {
        gw_begin(&first);
        s = &first;
    }
    if (!strchr("DPWF", said->what)) {
        int at = s->mind[said->agent];
        if (at >= room) {
            int old = room;
            while (at >= room) room = room ? 2 * room : 1024;
            gw_held = gw_grown(gw_held, (size_t)room * NATOMS);
            memset(gw_held + (size_t)old * NATOMS, 0, (size_t)(room - old) * NATOMS);
        }
        signed char *held = &gw_held[(size_t)at * NATOMS + atom];
        if (!*held) *held = 1 + gw_thinks(at, atom);
        return *held - 1;
    }
    gw_top = gw_ntrail = 0;
    gw_unbound(env);
    if (said->what == 'D')
        return s->last >= 0 && s->whose == said->agent &&
               gw_unify(gw_build(said->pat, env), gw_import(s->last, 0));
    if (said->what == 'W') return s->drawn;
    if (said->what == 'F' && !s->drawn) return 0;
    if (said->what == 'P') {
        int looking = 0;
        for (i = 0; i < NAGENTS; i++) looking |= gw_row(&gw_minds, s->mind[i], &n)[5];
        if (!looking || !s->begun || s->over) return 0;
    }
    n = gw_offered(s->now, found);
    for (i = 0; i < n; i++) {
        gw_unbound(env);
        if (gw_unifies(gw_build(said->pat, env), found[i])) return 1;
    }
    return 0;
}
