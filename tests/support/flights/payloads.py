"""Names that would do something wherever a name is taken for markup.

Every one holds its own mark, ``zq`` and two digits, in the part that would come alive: a page that
has the mark anywhere but in the whole name, as text, has interpreted it.
"""

import re

NAMES = {
    "jinja": "{{ cycler.__init__.__globals__.os.system('touch PWNED-zq01') }}",
    "slash and mathematics": "Phase $zq02_x$ 150MP/50mm",
    "a method's key": "single_step/heads/bundle/zq03",
    "img": "<img src=zq04 onerror=window.pwned=4>",
    "script": "<script>window.pwned='zq05'</script>",
    "image": "![zq06](http://zq06.example/a.png)",
    "link": "[zq07](javascript:window.pwned='zq07')",
    "autolink": "<http://zq08.example>",
    "bare link": "https://zq09.example/ www.zq09.example zq09@zq09.example",
    "tex": r"$\input{zq10}$",
    "unbalanced dollar": "a$zq11 $",
    "display math": r"$$\href{javascript:window.pwned=12}{zq12}$$",
    "backticks": "`zq13` ``zq13`",
    "fence": "``` {raw} html zq14",
    "directive": "```{eval-rst} .. raw:: html zq15",
    "include": "```{include} /etc/passwd zq16",
    "role": "{math}`zq17` {ref}`zq17` {download}`../conf.py <zq17>`",
    "raw role": "{raw html}`<b>zq18</b>`",
    "pipe": "a | zq19 | b \\| c",
    "colon fence": ":::{note} zq20",
    "comment": "% zq21",
    "break": "a +++ zq22",
    "target": "(zq23)=",
    "footnote": "[^zq24] [^zq24]: note",
    "html comment": "<!-- zq25 -->",
    "entities": "&lt;b&gt;zq26&lt;/b&gt; &#36;x&#36; &copy;",
    "format": "{} {0} {name} zq27 %s %(x)s %n",
    "path": "../../zq28/../x",
    "device": "CON",
    "quotes": "'zq30' \"quoted\" ''twice'' \"\"",
    "rich": "[red]zq31[/red] [link=http://zq31]x[/link] \\[b]",
    "emphasis": "*zq32* **zq32** _zq32_ ~~zq32~~ ^zq32^",
    "heading": "# zq33",
    "list": "1. zq34",
    "rule": "***zq35 --- ===",
    "quote": "> zq36 -- and ... 'so' ---",
    "emoji": "zq37 \N{GRINNING FACE}\N{ZERO WIDTH JOINER}\N{WOMAN} :smile:",
    "right to left": "zq38 שלום العربية (1)",
    "zero width": "zq39\N{ZERO WIDTH SPACE}a\N{SOFT HYPHEN}b\N{NO-BREAK SPACE}c\N{EM SPACE}d",
    "spaces": "  zq40   twice  ",
    "substitution": "|zq41| {{zq41}} {% raw %}zq41{% endraw %}",
    "attributes": "[zq42]{.zq42 #zq42 onclick=window.pwned=42}",
    "answer": "✗ fails",
    "unit": "mm^-2 ± zq44 sigma0_squared",
    "legend": "_zq45_nolegend_",
    "very long": "zq46" + 60 * "W" + "<i>" + 60 * "M",
    "heading of a column": "Parameter",
    "missing": "nan",
    "number": "1.0",
    "label": ":name: zq50",
    "definition": ": zq51",
    "style": "<style>body{display:none}</style>zq52",
    "svg": "]]>--><svg onload=window.pwned='zq53'>",
    "reference": "[zq54]: http://zq54.example",
    "html block": "<div hidden id=zq55>",
    "iframe": "<iframe srcdoc='<script>window.pwned=56</script>' name=zq56>",
    "gnss": "gnss_drift_zq57/a_east_m_per_min",
    "shell": "$(touch PWNED-zq58) `touch PWNED-zq58`; touch PWNED-zq58",
    "python": "__import__('os').system('touch PWNED-zq59')",
    "comma": 'a,"zq60",b;c',
}
"""By what they try."""

MARK = re.compile(r"zq\d\d")


def marks(text: str) -> list[str]:
    """Return the marks of a text in their order."""
    return MARK.findall(text)
