"""The style sheet of pages: light and dark, narrow and wide, on screen and in print."""

from __future__ import annotations

from collections.abc import Mapping

from sva_bench.palette import ALARM, ROBOTS, SITES, hex_of

LIGHT: Mapping[str, str] = {
    "paper": "#ffffff", "ink": "#1b1e22", "soft": "#4a515a", "line": "#d5dae0", "fill": "#f2f4f6", "answer": "#eef4f8",
    "edge": "#2d6f94", "link": "#0b5a86", "solid": "#b3b8be", "free": "#fbfbfc", "faint": ".35",
    "alarm": hex_of(ALARM)}
DARK: Mapping[str, str] = {
    "paper": "#16191d", "ink": "#e7e9ec", "soft": "#aab2bb", "line": "#3a4149", "fill": "#21262c", "answer": "#1b2731",
    "edge": "#5fa8d0", "link": "#7dc0e8", "solid": "#4c535c", "free": "#1c2025", "faint": ".8",
    "alarm": "#ff6257"}
"""Colours of a page in each mode, and the opacity of a leg that is hardly ever driven, by the names of variables."""
_DASHES = ("none", "7 3.5", "0.1 4.5", "9 3 2 3", "15 4")  # the third one's are dots: its ends are round


def _variables(colours: Mapping[str, str]) -> str:
    return ";".join(f"--{name}:{colour}" for name, colour in colours.items())


def _robots() -> str:
    return "".join(
        f".leg.r{k} path{{stroke:{hex_of(colour)};stroke-dasharray:{dash}"
        f"{';stroke-linecap:round' * dash.startswith('0.1')}}}.leg.r{k} .head{{fill:{hex_of(colour)}}}\n"
        for k, (colour, dash) in enumerate(zip(ROBOTS, _DASHES, strict=True)))


STYLE = f"""
:root{{color-scheme:light dark;{_variables(LIGHT)}}}
@media screen and (prefers-color-scheme:dark){{:root{{{_variables(DARK)}}}}}
*{{box-sizing:border-box}}
body{{font:16px/1.5 system-ui,sans-serif;max-width:76rem;margin:0 auto;padding:1rem;color:var(--ink);
background:var(--paper)}}
h1,h2,p,li,figcaption,summary{{overflow-wrap:anywhere}}a{{color:var(--link)}}
h1{{font-size:1.5rem;line-height:1.25;margin:.4rem 0}}h2{{font-size:1.2rem;margin:2.2rem 0 .4rem}}
p{{margin:.5rem 0}}
.answer{{border-left:.4rem solid var(--edge);background:var(--answer);padding:.6rem 1rem;margin:.8rem 0}}
.answer p:first-child{{font-size:1.15rem;font-weight:600;margin-top:0}}.answer ul{{margin:.3rem 0;padding-left:1.2rem}}
.answer .note{{max-width:none}}
dl{{display:grid;grid-template-columns:max-content 1fr;gap:.25rem .9rem;margin:.6rem 0 .2rem;font-size:.92rem}}
dt{{font-weight:600;grid-column:1}}dd{{margin:0;grid-column:2;overflow-wrap:anywhere}}
.whole{{white-space:nowrap}}pre .whole{{display:inline-block;max-width:100%;white-space:normal}}
.doubt{{border-left:.25rem solid var(--alarm);padding-left:.6rem}}
nav{{font-size:.92rem;margin:.8rem 0;color:var(--soft)}}nav a{{margin-right:.9rem;display:inline-block}}
.wide{{overflow-x:auto;max-width:max-content;background:linear-gradient(90deg,var(--paper) 30%,transparent),
linear-gradient(270deg,var(--paper) 30%,transparent) 100% 0,
linear-gradient(90deg,color-mix(in srgb,var(--ink) 35%,transparent),transparent),
linear-gradient(270deg,color-mix(in srgb,var(--ink) 35%,transparent),transparent) 100% 0;
background-repeat:no-repeat;background-size:3rem 100%,3rem 100%,.9rem 100%,.9rem 100%;
background-attachment:local,local,scroll,scroll}}
.wide:focus-visible{{outline:2px solid var(--edge)}}
table{{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.92rem}}
th,td{{padding:.3rem .7rem;text-align:right;border-bottom:1px solid var(--line);vertical-align:top}}
thead th{{border-bottom:2px solid var(--soft)}}.text{{text-align:left}}td.text{{white-space:nowrap}}
th.section{{overflow-wrap:anywhere;padding-top:.7rem;background:color-mix(in srgb,var(--ink) 5%,transparent)}}
tbody:first-of-type tr:first-child .section{{padding-top:.3rem}}
td.long{{white-space:normal;min-width:16rem;overflow-wrap:anywhere}}
td b{{font-weight:600}}
figure.rows>figcaption{{padding-bottom:.3rem}}
figure{{margin:1rem 0;break-inside:avoid}}figure svg{{max-width:100%;height:auto;display:block}}
figure svg text{{fill:var(--ink)}}
figcaption{{color:var(--soft);font-size:.92rem;margin-top:.3rem}}
.pair{{display:flex;flex-wrap:wrap;gap:1rem 2rem}}.pair>*{{flex:1 1 26rem;min-width:0}}
.note{{color:var(--soft);font-size:.92rem;max-width:60rem}}
code{{background:var(--fill);padding:.1rem .3rem;overflow-wrap:anywhere}}
pre{{background:var(--fill);padding:.6rem;white-space:pre-wrap}}pre code{{padding:0}}
details{{margin:.6rem 0}}summary{{cursor:pointer;padding:.3rem .5rem;background:var(--fill);border-radius:.25rem}}
summary h2{{display:inline;margin:0}}
.maps{{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,max(20rem,40%)),1fr));gap:.4rem 1.6rem;
align-items:start;margin-top:.6rem}}
.map{{margin:0 0 .6rem;max-width:38rem;display:grid;grid-template-rows:subgrid;grid-row:span 3;justify-items:start}}
.map svg{{width:100%}}.map b{{display:block}}.map li b{{display:inline}}
.map figcaption{{color:var(--ink);padding-left:1rem;print-color-adjust:exact;
background:linear-gradient(var(--plan) 50%,var(--other,var(--plan)) 50%) 0/.5rem 100% no-repeat}}
.map ul{{list-style:none;margin:0;padding:0;font-size:.92rem}}.map li{{margin:.2rem 0;overflow-wrap:anywhere}}
.map span{{color:var(--soft)}}
svg.k{{width:1.9rem!important;height:.55rem;margin-right:.4rem;vertical-align:middle;display:inline-block}}
.solid{{fill:var(--solid)}}.free{{fill:var(--free)}}.cells{{image-rendering:pixelated}}
.slippery{{fill:#7fb6d3;fill-opacity:.35;stroke:#5b98b8;stroke-dasharray:3 2}}
.passage{{stroke:#1d9a74;stroke-width:3;stroke-dasharray:4 2.5;fill:none}}
.stand{{fill:none;stroke:var(--soft);stroke-dasharray:2 2}}
.plan text{{font:600 11px system-ui,sans-serif;text-anchor:middle;paint-order:stroke;stroke:var(--free);
stroke-width:3px;stroke-linejoin:round}}
.plan text.small{{font-weight:400;font-size:10px}}
.plan .base{{fill:var(--ink);stroke:var(--free)}}.station{{fill:{hex_of(SITES["station"])};stroke:#0b3b2d}}
.poi{{fill:{hex_of(SITES["poi"])};stroke:#4a4310}}
.plan .scale path{{fill:none;stroke:var(--ink);stroke-width:1.2}}
.plan .scale text{{font-weight:400;font-size:10px;text-anchor:end;stroke:none}}
.leg path{{fill:none;stroke-width:calc(1.5px + .9px*var(--often,1));stroke-linejoin:round}}
.leg{{opacity:calc(var(--faint) + (1 - var(--faint))*var(--often,1))}}.leg .head{{stroke:none!important}}
{_robots()}.leg.replanned path{{stroke-width:4.2}}
.leg.replanned .core{{stroke:var(--free);stroke-width:2;stroke-dasharray:none}}
.leg:hover path:not(.core){{stroke-width:5.2}}.ended circle{{fill:var(--free);stroke:var(--alarm);stroke-width:1.6}}
.ended path{{stroke:var(--alarm);stroke-width:2}}
.plan .ended text,.plan .met text{{font-size:10px}}
.met path{{fill:var(--alarm);stroke:var(--free)}}.met.wait path{{fill:#8a4fb0}}
svg.rows,svg.panel{{font:12px system-ui,sans-serif;width:100%}}svg.rows{{max-width:29rem}}
.rows .group,.panel .name{{font-weight:600}}.rows .told{{text-anchor:end}}
.rows .tick,.panel .tick{{text-anchor:middle;font-size:11px;fill:var(--soft)}}
.rows .below{{paint-order:stroke;stroke:var(--fill);stroke-width:3px;stroke-linejoin:round}}
.rows .lane,.panel .lane{{fill:var(--fill)}}.rows .span{{fill-opacity:.75}}
.rows .grid,.panel .grid{{stroke:var(--line)}}.rows .zero,.panel .zero{{stroke:var(--soft)}}
.rows .steps,.panel .joined{{fill:none;stroke-width:1.8}}.panel .joined{{stroke:var(--soft);stroke-width:1.2}}
.panel .tick.left{{text-anchor:end}}.panel .aim{{stroke:var(--soft);stroke-dasharray:4 3}}
.panel .bar{{stroke-width:2.2}}.panel .ring{{fill:none;stroke:var(--ink);stroke-width:1.4}}
.legend{{font-size:.92rem}}.legend span{{margin-right:1.2rem}}.legend svg.k{{width:.8rem!important;height:.8rem}}
.panels{{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,15.5rem),1fr));
gap:.6rem 1.4rem}}
.panels svg{{max-width:20rem}}
@media(max-width:40rem){{body{{font-size:15px;padding:.8rem}}th,td{{padding:.25rem .3rem}}table{{font-size:.88rem}}
.answer{{padding:.5rem .7rem}}dl{{display:block}}dd{{margin-bottom:.4rem}}}}
@media print{{html,body{{font-size:10pt}}body{{max-width:none;padding:0}}.wide{{overflow:visible;background:none}}
h2,h3,summary,thead,tr:has(>.section),figure.rows>figcaption:not(:last-child),nav,h2+.note,h2+p,p.legend{{break-after:avoid}}
details::details-content{{break-before:avoid}}table.few,figure:has(>.wide>.few),figure:has(>.panels),li:not(:has(ul)){{break-inside:avoid}}
li>b{{break-after:avoid}}li:has(>ul)>ul{{break-before:avoid}}
details:has(>.pair),.pair{{break-inside:avoid}}.panels{{display:block}}
.panels svg{{display:inline-block!important;width:31%;margin-right:1.5%}}
nav{{display:none}}tr,.map,table:not(.few) tbody:not(:only-of-type){{break-inside:avoid}}
.map svg{{max-width:310px!important}}
figure.rows:not(:has(>.wide>.few,>.panels)){{break-inside:auto}}
details::details-content{{content-visibility:visible!important;block-size:auto!important;display:block!important}}
summary{{list-style:none}}
table{{font-size:8pt}}
th,td,td.text{{white-space:normal;padding:.15rem .25rem}}td.long{{min-width:0}}a{{color:inherit}}}}
"""
