# ruff: noqa: RUF001
"""Words that are nearly the taught ones are refused, in any language, and what may have been meant is suggested."""

import pytest

from app.pipeline.errors import InstructionError
from app.pipeline.order.reading import read
from app.pipeline.order.taught import TaughtWords
from app.pipeline.steps.reading import read_steps
from app.pipeline.steps.skills import Skill, TasksOfScene

ENGLISH_BUTTONS = ("red button", "blue button")
TASKS = {
    "push": (ENGLISH_BUTTONS, ["push the red button", "push the blue button"]),
    "drawer": (("left drawer", "right drawer"), ["open the left drawer", "open the right drawer"]),
    "lab": (("copper sulphate", "tray"), ["put the copper sulphate on the tray"]),
    "glass": (("glass", "brass tap", "lens"), ["take the glass", "take the lens", "turn the brass tap"]),
    "no": (("button",), ["press the button no longer than the bell rings"]),
    "notable": (("notable box",), ["push the notable box"]),
    "chinese": (("红色按钮", "蓝色按钮"), ["按红色按钮", "按蓝色按钮", "把红色按钮向左转"]),
    "chinese, English names": (ENGLISH_BUTTONS, ["按红色按钮", "按蓝色按钮"]),
    "one Chinese button": (("红色按钮",), ["按红色按钮"]),
    "japanese": (("赤いボタン", "青いボタン"), ["赤いボタンを押して", "青いボタンを左に回して"]),
    "korean": (("빨간 버튼", "파란 버튼"), ["빨간 버튼을 눌러", "왼쪽 서랍을 열어", "오른쪽 서랍을 열어"]),
    "german": (("roter Knopf", "Kopf", "Knopf"), ["drücke den Knopf", "dreh den Kopf nach links"]),
    "german, one button": (("Knopf",), ["drücke den Knopf nicht lange", "drücke den Knopf"]),
    "french": (("bouton rouge", "bouton bleu"), ["appuie sur le bouton rouge", "n'ouvre que la boîte de gauche"]),
    "spanish": (("botón rojo", "botón azul"), ["pulsa el botón rojo", "gira el botón rojo a la izquierda"]),
    "russian": (("красная кнопка", "синяя кнопка"), ["нажми красную кнопку", "нажми синюю кнопку"]),
    "arabic": (("الزر الأحمر", "الزر الأزرق"), ["اضغط الزر الأحمر", "اضغط الزر الأزرق"]),
    "hindi": (("लाल बटन", "नीला बटन"), ["लाल बटन दबाओ", "नीला बटन दबाओ"]),
    "thai": (("ปุ่มแดง",), ["กดปุ่มแดง"]),
    "turkish": (("düğme",), ["kırmızı düğmeyi it", "düğmeyi sola çevir"]),
    "norwegian": (("knapp",), ["press den røde knappen, ikke den blå", "press den blå knappen, ikke den røde"]),
}
TAUGHT = {task: TaughtWords(names, {}, texts) for task, (names, texts) in TASKS.items()}

# What is said of each task, line by line.
REFUSED = {
    "push": """
        push the rad button
        push the bleu button
        push the yelow button
        psuh the red button
        push teh red button
        push the red buttom
        pusch the red button
        push the read button
        push the redd button
        push not the red button
        dont push the red button
        pushed the red button
        push the red button?
        push the red button ？
        could you push the red button؟
        is the red button pushed⁇
        push the red button? Thank you!
    """,
    "drawer": """
        open the rigth drawer
        open the lift drawer
        opne the left drawer
        open the light drawer
        open the left draw
        opened the left drawer
        reopen the left drawer
    """,
    "lab": """
        put the copper sulphide on the tray
        put the copper sulphite on the tray
        put the copper sulphate on the try
    """,
    "glass": "take the glas / take the grass / take the len / turn the bras tap / taping the glass / turn brass tab",
    "no": "press no button / press the button no / no press the button",
    "notable": "push the not able box / push the not box",
    "chinese": """
        别按红色按钮
        不按红色按钮
        不要按红色按钮
        按红色按钮吗
        按红色按钮？
        按红按钮
        按绿色按钮
        把红色按钮向右转
        把按钮红色向左转
        按红色 按钮
        按＜0＞
    """,
    "chinese, English names": "别按红色按钮 / 不按红色按钮 / 按红按钮 / 按 red button",
    "one Chinese button": "别按红色按钮 / 不按红色按钮 / 按按钮 / 按红色按钮 红色按钮",
    "japanese": """
        赤いボタンを押さないで
        赤いボタンを押した
        赤いボタンを押して？
        青いボタンを右に回して
        赤いボタンを右に回して
        赤ボタンを押して
    """,
    "korean": """
        빨간 버튼을 누르지 마
        빨간 버튼을 눌렀어
        빨간버튼을 눌러
        왼쪽 서랍을 닫아
        왼 서랍을 열어
    """,
    "german": """
        drückte den Knopf
        drücke den Kropf
        drücke den Knopf nicht
        drücke nicht den Knopf
        drück den Knopf
        dreh den Kopf nach rechts
        dreh den Kopf links
        drücke Knopf
        den Knopf drücke
    """,
    "german, one button": """
        drücke nicht
        drücke den Knopf nicht
        drücke den Knopf lange nicht
        drücke den lange Knopf
        nicht drücke den Knopf
    """,
    "french": """
        n'appuie pas sur le bouton rouge
        appuie sous le bouton rouge
        appuies sur le bouton rouge
        appuie sur le bouton rouge pas
        appuyer sur le bouton rouge
    """,
    "spanish": """
        no pulses el botón rojo
        no pulsa el botón rojo
        pulsó el botón rojo
        gira el botón rojo a la derecha
        pulsa el boton rojo
        ¿pulsa el botón rojo?
    """,
    "russian": "не нажми красную кнопку / не нажимай красную кнопку / нажми красную кнопка / нажми зелёную кнопку",
    "arabic": "لا تضغط الزر الأحمر / اضغط الزر الأخضر / اضغط الزر الأحمر؟ / ضغط الزر الأحمر",
    "hindi": "लाल बटन मत दबाओ / नीली बटन दबाओ / लाल बटन दबाया / push the नीली बटन",
    "thai": "อย่ากดปุ่มแดง / กดปุ่มแดงไหม / กดปุ่มแดงๆ",
    "turkish": "kırmızı düğmeyi itme / kirmizi düğmeyi it / düğmeyi sağa çevir",
    "norwegian": "press den røde knappen / press ikke den røde knappen / press den blå, ikke den blå knappen",
}  # fmt: skip


def lines(text):
    return [line.strip() for line in text.replace(" / ", "\n").strip().splitlines()]


NEAR_MISSES = [(task, said) for task, text in REFUSED.items() for said in lines(text)]


@pytest.mark.parametrize(("task", "said"), NEAR_MISSES)
@pytest.mark.parametrize("options", [{}, {"allow_unfamiliar": True}], ids=["refuse", "allow"])
def test_a_near_miss_is_refused(task, said, options):
    with pytest.raises(InstructionError):
        read(said, TAUGHT[task], **options)


@pytest.mark.parametrize(("task", "said"), NEAR_MISSES)
def test_a_near_miss_is_no_step_of_a_plan(task, said):
    scene = TasksOfScene(TASKS[task][0], {}, [Skill(task, TAUGHT[task])])
    with pytest.raises(InstructionError):
        read_steps(said, scene, None)


RIGHT = {
    "push": [("PUSH  the Red button.", "red button"), ("ｐｕｓｈ the blue button", "blue button"),
             ("could you press the red one", "red button")],
    "chinese": [("按红色按钮", "红色按钮"), ("按蓝色按钮", "蓝色按钮"), ("把蓝色按钮向左转", "蓝色按钮")],
    "chinese, English names": [("按红色按钮", None)],
    "japanese": [("赤いボタンを押して", "赤いボタン"), ("青いボタンを押して", "青いボタン"),
                 ("赤いﾎﾞﾀﾝを押して", "赤いボタン")],
    "korean": [("파란 버튼을 눌러", "파란 버튼"), ("왼쪽 서랍을 열어", None)],
    "german": [("DRÜCKE den  Knopf", "Knopf"), ("drücke den Kopf", "Kopf"),
               ("dru\u0308cke den roter Knopf", "roter Knopf")],
    "spanish": [("pulsa el botón azul", "botón azul"), ("Pulsa el boto\u0301n rojo", "botón rojo")],
    "arabic": [("اضغط الزر الأزرق", "الزر الأزرق")],
    "hindi": [("नीला बटन दबाओ", "नीला बटन")],
    "thai": [("กดปุ่มแดง", "ปุ่มแดง")],
    "turkish": [("düğmeyi sola çevir", None)],
    "norwegian": [("press den blå knappen, ikke den røde", None)],
}  # fmt: skip


@pytest.mark.parametrize(("task", "said", "name"), [(task, *item) for task, items in RIGHT.items() for item in items])
def test_the_taught_words_are_accepted_in_any_case_and_unicode_form(task, said, name):
    assert read(said, TAUGHT[task]).objects == (() if name is None else (name,))


@pytest.mark.parametrize(
    ("task", "said", "meant"),
    [
        ("push", "push the bleu button", "blue"),
        ("push", "psuh the red button", "push"),
        ("push", "push the red button up", "push the red button"),
        ("lab", "put the copper sulphide on the tray", "sulphate"),
        ("german", "drückte den Knopf", "drücke"),
        ("chinese", "不按红色按钮", "按红色按钮"),
        ("korean", "왼쪽 서랍을 닫아", "왼쪽 서랍을 열어"),
    ],
)
def test_a_refusal_suggests_what_may_have_been_meant(task, said, meant):
    with pytest.raises(InstructionError, match=f"did you mean {meant!r}"):
        read(said, TAUGHT[task])


@pytest.mark.parametrize(
    "said",
    ["stop", "do not press the red button", "is it pressed?", "is the red button pressed", "avoid the red button",
     "push all but the red button", "push the button other than the red button", "push anything but the red button",
     "drücke den red button nicht", "别按 red button", "stop pushing the red button", "leave the red button alone",
     "pull the red button or the blue button", "I pressed the red button", "no red button"],
)  # fmt: skip
def test_what_may_forbid_something_is_refused_even_if_unfamiliar_words_are_allowed(said):
    with pytest.raises(InstructionError):
        read(said, TAUGHT["push"], allow_unfamiliar=True)
